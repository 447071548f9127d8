"""What labelling leaves in a run's folder: the labelled cloud, and counts of points in the map's file."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np

from ...datasets.errors import InputError
from ...datasets.truth import NO_OBJECT
from ..export.colors import class_color
from ..map.atomic import write_atomic
from ..map.labels_file import write_labels
from ..map.map_to_document import format_document
from ..map.object_map import ObjectMap
from ..map.store import AGAIN, OutputFolder
from .instances import Instances, ThingPoints
from .labelling import Labels
from .voxels import Voxels

BACKGROUND = "background"
POINTS, VOLUME = "points", "volume"  # of a thing of the map's file, as it is read back: what labelling adds
PLACE = ("position", "size", "size_std", "yaw")  # of a thing; those that the graph had are kept as its `VOLUME`


def read_volumes(folder: OutputFolder) -> ObjectMap:
    """The map of a run as it was estimated: without people's edits, and with the sizes that it had before labelling.

    What is labelled must not depend on what was labelled before.

    Raises:
        InputError: the folder holds no map.
    """
    object_map = folder.read_map(edits=False)
    things = (thing if thing.volume is None else thing.volume.of(thing) for thing in object_map.things)
    return replace(object_map, things=tuple(things))


def write_labelling(
    folder: OutputFolder, object_map: ObjectMap, voxels: Voxels, labels: Labels, instances: Instances | None
) -> dict[str, int]:
    """Write labels.ply and add counts to map.json; returns class -> number of points, the background's last.

    Args:
        folder: of the run.
        object_map: its map.
        voxels: N, a point each.
        labels: of the N points.
        instances: whose the points are; None where nobody knows.
    """
    label = labels.label
    colors = labelled_colors(voxels.colours, label, object_map.classes)
    ids = [thing.id for thing in object_map.things]
    own = labels.of_points(None if instances is None else instances.number)
    write_labels(folder.labels_file, voxels.points, colors, own, object_map.classes, ids)
    points = {name: int(np.sum(label == k)) for k, name in enumerate(object_map.classes)}
    points = {name: count for name, count in points.items() if count} | {BACKGROUND: int(np.sum(label == NO_OBJECT))}
    _add_counts(folder, object_map, points, instances)
    return points


def labelled_colors(colors: np.ndarray, label: np.ndarray, classes: tuple[str, ...]) -> np.ndarray:
    """(N, 3) uint8 RGB: points of a class in its colour, the background's as they were seen, (N, 3) 0..255."""
    table = np.array([class_color(name) for name in classes], dtype=np.uint8).reshape(-1, 3)
    seen = np.clip(np.round(np.nan_to_num(colors)), 0, 255).astype(np.uint8)
    return np.where((label == NO_OBJECT)[:, None], seen, table[label])


def _add_counts(
    folder: OutputFolder, object_map: ObjectMap, points: dict[str, int], instances: Instances | None
) -> None:
    """Beside the map's other values `labels`, with the file and the points of each class; for each thing its points.

    A thing whose points disagree with its size, or lie on a box, takes the place and the size that they tell; what the
    graph had stays beside it as `volume`. Readers that do not know these pass over them.
    """
    document = _read(folder)
    things = document.pop("things")
    own = {} if instances is None else {one.id: one for one in instances.things}
    for thing in things:
        thing |= thing.pop(VOLUME, {})
        thing.pop(POINTS, None)
        if thing["id"] in own:
            thing |= _of_points(own[thing["id"]], thing, object_map.R_world_upright)
    document |= {"labels": {"file": folder.labels_file.name, "points": points}, "things": things}
    write_atomic(folder.map_file, format_document(document).encode())


def _of_points(found: ThingPoints, thing: dict[str, Any], R_world_upright: np.ndarray) -> dict[str, Any]:
    """What changes of a thing of the map's file."""
    values: dict[str, Any] = {POINTS: found.points}
    if found.size is None or found.size.estimate is None or found.size.std is None:
        return values
    values |= {"size": found.size.estimate.tolist(), "size_std": found.size.std.tolist()}
    if found.box is not None:
        values |= {"position": (R_world_upright @ found.box.center).tolist(), "yaw": found.box.yaw}
    return values | {VOLUME: {name: thing[name] for name in PLACE}}


def _read(folder: OutputFolder) -> dict[str, Any]:
    """The document of the map's file; raises `InputError` where it is none."""
    try:
        return json.loads(folder.map_file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(folder.map_file, "a map in JSON", str(error), AGAIN) from None
