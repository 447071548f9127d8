"""What labelling leaves in a run's folder: the labelled cloud, and counts of points in the map's file."""

from __future__ import annotations

import json

import numpy as np

from ...datasets.errors import InputError
from ...datasets.truth import NO_OBJECT
from ..export.colors import class_color
from ..map.atomic import write_atomic
from ..map.map_file import format_document
from ..map.object_map import ObjectMap
from ..map.store import AGAIN, OutputFolder
from .voxels import Voxels

BACKGROUND = "background"


def write_labelling(
    folder: OutputFolder, object_map: ObjectMap, voxels: Voxels, label: np.ndarray, instance: np.ndarray | None
) -> dict[str, int]:
    """Write labels.ply and add counts to map.json; returns class -> number of points, the background's last.

    Args:
        folder: of the run.
        object_map: its map.
        voxels: N, a point each.
        label: (N,) indices into the map's classes, `NO_OBJECT` for background.
        instance: (N,) number of each point's thing in the map, from 1 on, 0 for none; None where nobody knows.
    """
    colors = labelled_colors(voxels.colours, label, object_map.classes)
    ids = [thing.id for thing in object_map.things]
    folder.write_labels(voxels.points, colors, label, object_map.classes, instance, ids)
    points = {name: int(np.sum(label == k)) for k, name in enumerate(object_map.classes)}
    points = {name: count for name, count in points.items() if count} | {BACKGROUND: int(np.sum(label == NO_OBJECT))}
    owned = None if instance is None else np.bincount(instance, minlength=len(ids) + 1)[1:].tolist()
    _add_counts(folder, points, owned)
    return points


def labelled_colors(colors: np.ndarray, label: np.ndarray, classes: tuple[str, ...]) -> np.ndarray:
    """(N, 3) uint8 RGB: points of a class in its colour, the background's as they were seen, (N, 3) 0..255."""
    table = np.array([class_color(name) for name in classes], dtype=np.uint8).reshape(-1, 3)
    seen = np.clip(np.round(np.nan_to_num(colors)), 0, 255).astype(np.uint8)
    return np.where((label == NO_OBJECT)[:, None], seen, table[label])


def _add_counts(folder: OutputFolder, points: dict[str, int], owned: list[int] | None) -> None:
    """Beside the map's other values `labels`, with the file and the points of each class; for each thing its points.

    Readers that do not know these pass over them.
    """
    try:
        document = json.loads(folder.map_file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(folder.map_file, "a map in JSON", str(error), AGAIN) from None
    things = document.pop("things")
    for number, thing in enumerate(things):
        thing.pop("points", None)
        if owned is not None:
            thing["points"] = owned[number]
    document |= {"labels": {"file": folder.labels_file.name, "points": points}, "things": things}
    write_atomic(folder.map_file, format_document(document).encode())
