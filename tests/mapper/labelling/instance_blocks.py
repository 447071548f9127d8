"""Blocks of labelled voxels and things with boxes, for tests of instances."""

from __future__ import annotations

import numpy as np

from thingmap.datasets.truth import NO_OBJECT
from thingmap.mapper.labelling.box_config import BoxConfig
from thingmap.mapper.labelling.labelling import Labels
from thingmap.mapper.labelling.labelling_config import LabellingConfig
from thingmap.mapper.labelling.voxel_merge import Voxels
from thingmap.mapper.map.object_map import MapFrame, ObjectMap
from thingmap.mapper.map.thing import Evidence, Thing
from thingmap.mapper.map.up_direction import UpDirection

CLASSES = ("cup", "bowl")
NO_BOXES = LabellingConfig(boxes=BoxConfig(round_from=0.0))  # blocks, as boxes as they are, are taken for round things


def block(corner, size) -> np.ndarray:
    """(n, 3) cells of a solid block."""
    return (np.indices(size).reshape(3, -1).T + corner).astype(np.int32)


def make_voxels(parts) -> tuple[Voxels, Labels, list[np.ndarray]]:
    """1 cm voxels of (cells, label) parts, sorted as they must be, and the rows of each part."""
    cells = np.concatenate([np.empty((0, 3), np.int32)] + [cells for cells, _ in parts])
    label = np.concatenate([np.empty(0, np.int64)] + [np.full(len(cells), k) for cells, k in parts])
    part = np.repeat(np.arange(len(parts)), [len(cells) for cells, _ in parts])
    order = np.lexsort(cells.T[::-1])
    row = np.empty(len(cells), np.intp)
    row[order] = np.arange(len(cells))
    cells, n = cells[order], len(cells)
    voxels = Voxels(
        size=0.01,
        cells=cells,
        points=(cells + 0.5) * 0.01,
        colours=np.zeros((n, 3), np.float32),
        normals=np.full((n, 3), np.nan, np.float32),
        log_p=np.zeros((n, len(CLASSES) + 1), np.float32),
        count=np.ones(n, np.int32),
        views=np.ones(n, np.int32),
    )
    label = label[order].astype(np.int64)
    second, margin = np.full(n, NO_OBJECT), np.ones(n, np.float32)
    labels = Labels(label=label, second=second, margin=margin, pairs=0, energy=0.0, gap=None, settled=True)
    return voxels, labels, [row[part == p] for p in range(len(parts))]


def make_thing(
    number, label, position, size=(0.08, 0.08, 0.08), *, posterior=None, existence=1.0, yaw=0.0, size_std=0.01
) -> Thing:
    posterior = posterior or {label: 1.0}
    return Thing(
        id=f"thing-{number:04d}",
        label=label,
        probability=posterior[label],
        existence=existence,
        class_posterior=posterior,
        position=np.array(position),
        position_covariance=np.eye(3) * 0.002**2,
        size=np.array(size),
        size_std=np.full(3, size_std),
        yaw=yaw,
        first_seen=0.0,
        last_seen=1.0,
        evidence=Evidence(3, 0, 0),
    )


def make_map(things) -> ObjectMap:
    up = UpDirection(np.array([0.0, 0.0, 1.0]), 0.01, "test")
    return ObjectMap(tuple(things), CLASSES, "test", MapFrame.DATASET, up)
