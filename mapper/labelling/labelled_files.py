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
from ..map.map_to_document import format_document
from ..map.object_map import ObjectMap
from ..map.store import AGAIN, OutputFolder
from .instances import Instances, ThingPoints
from .voxels import Voxels

BACKGROUND = "background"
POINTS_KEYS = ("points", "points_size", "points_size_std")  # of a thing of the map, as `map_file` reads them
SIZE_KEYS = ("size", "size_std")
VOLUME = "volume_"  # before the names of those that were the volume's own, where points have changed them


def read_volumes(folder: OutputFolder) -> ObjectMap:
    """The map of a run as it was estimated: without people's edits, and with the sizes that it had before labelling.

    What is labelled must not depend on what was labelled before.

    Raises:
        InputError: the folder holds no map.
    """
    object_map, document = folder.read_map(edits=False), _read(folder)
    before = {str(one["id"]): one for one in document["things"] if VOLUME + SIZE_KEYS[0] in one}
    things = []
    for thing in object_map.things:
        if (own := before.get(thing.id)) is not None:
            thing = replace(thing, **{name: np.array(own[VOLUME + name], dtype=np.float64) for name in SIZE_KEYS})
        things.append(thing)
    return replace(object_map, things=tuple(things))


def write_labelling(
    folder: OutputFolder, object_map: ObjectMap, voxels: Voxels, label: np.ndarray, instances: Instances | None
) -> dict[str, int]:
    """Write labels.ply and add counts to map.json; returns class -> number of points, the background's last.

    Args:
        folder: of the run.
        object_map: its map.
        voxels: N, a point each.
        label: (N,) indices into the map's classes, `NO_OBJECT` for background.
        instances: whose the points are; None where nobody knows.
    """
    colors = labelled_colors(voxels.colours, label, object_map.classes)
    ids = [thing.id for thing in object_map.things]
    number = None if instances is None else instances.number
    folder.write_labels(voxels.points, colors, label, object_map.classes, number, ids)
    points = {name: int(np.sum(label == k)) for k, name in enumerate(object_map.classes)}
    points = {name: count for name, count in points.items() if count} | {BACKGROUND: int(np.sum(label == NO_OBJECT))}
    _add_counts(folder, points, instances)
    return points


def labelled_colors(colors: np.ndarray, label: np.ndarray, classes: tuple[str, ...]) -> np.ndarray:
    """(N, 3) uint8 RGB: points of a class in its colour, the background's as they were seen, (N, 3) 0..255."""
    table = np.array([class_color(name) for name in classes], dtype=np.uint8).reshape(-1, 3)
    seen = np.clip(np.round(np.nan_to_num(colors)), 0, 255).astype(np.uint8)
    return np.where((label == NO_OBJECT)[:, None], seen, table[label])


def _add_counts(folder: OutputFolder, points: dict[str, int], instances: Instances | None) -> None:
    """Beside the map's other values `labels`, with the file and the points of each class; for each thing its points.

    A thing whose points disagree with its size takes the size of both (`points_size`); its volume's own stays beside it
    as `volume_size` and `volume_size_std`. Readers that do not know these pass over them.
    """
    document = _read(folder)
    things = document.pop("things")
    own = {} if instances is None else {one.id: one for one in instances.things}
    for thing in things:
        for name in SIZE_KEYS:
            thing[name] = thing.pop(VOLUME + name, thing[name])
        for name in POINTS_KEYS:
            thing.pop(name, None)
        if thing["id"] in own:
            thing |= _of_points(own[thing["id"]], thing)
    document |= {"labels": {"file": folder.labels_file.name, "points": points}, "things": things}
    write_atomic(folder.map_file, format_document(document).encode())


def _of_points(found: ThingPoints, thing: dict[str, Any]) -> dict[str, Any]:
    """What changes of a thing of the map's file."""
    values: dict[str, Any] = {"points": found.points}
    if found.size is not None and found.size.estimate is not None and found.size.std is not None:
        for name, value in zip(SIZE_KEYS, (found.size.estimate.tolist(), found.size.std.tolist()), strict=True):
            values |= {name: value, f"points_{name}": value, VOLUME + name: thing[name]}
    return values


def _read(folder: OutputFolder) -> dict[str, Any]:
    """The document of the map's file; raises `InputError` where it is none."""
    try:
        return json.loads(folder.map_file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(folder.map_file, "a map in JSON", str(error), AGAIN) from None
