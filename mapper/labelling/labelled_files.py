"""What labelling leaves in a run's folder: the labelled cloud, and counts of points in the map's file."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ...datasets.errors import InputError
from ...datasets.truth import NO_OBJECT
from ..export.colors import class_color
from ..map.atomic import write_atomic
from ..map.map_file import format_document
from ..map.object_map import ObjectMap
from ..map.store import AGAIN, OutputFolder
from .instances import Instances, ThingPoints
from .voxels import Voxels

BACKGROUND = "background"
POINTS_KEYS = ("points", "points_size", "points_size_std")  # of a thing of the map, as `map_file` reads them


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
    """Beside the map's other values `labels`, with the file and the points of each class; for each thing its points,
    and the size that they suggest where the map has another.

    Readers that do not know these pass over them.
    """
    try:
        document = json.loads(folder.map_file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(folder.map_file, "a map in JSON", str(error), AGAIN) from None
    things = document.pop("things")
    for number, thing in enumerate(things):
        for name in POINTS_KEYS:
            thing.pop(name, None)
        if instances is not None:
            thing |= _of_points(instances.things[number])
    document |= {"labels": {"file": folder.labels_file.name, "points": points}, "things": things}
    write_atomic(folder.map_file, format_document(document).encode())


def _of_points(thing: ThingPoints) -> dict[str, Any]:
    values: dict[str, Any] = {"points": thing.points}
    if thing.size is not None and thing.size.estimate is not None and thing.size.std is not None:
        values |= {"points_size": thing.size.estimate.tolist(), "points_size_std": thing.size.std.tolist()}
    return values
