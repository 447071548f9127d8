"""A bowl of which a detector says little stands on a table: its inside is not the table's."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from thingmap.datasets.truth import NO_OBJECT
from thingmap.mapper.labelling.labelling import label_voxels
from thingmap.mapper.labelling.mrf_config import MrfConfig
from thingmap.mapper.labelling.voxels import Voxels

BOWL, SIZE = 0, 0.01  # a class; m
TABLE, FLOOR, FOOT = 0.5, 1.3, 3.0  # edges of a voxel: heights of the table and of the floor inside, radius of the foot
INNER, OUTER, RIM = 8.0, 8.6, 5.5  # radii of the spheres, and the rim's height above the floor
INSIDE, OUTSIDE, AROUND = range(3)


def cap(radius: float, bottom: float, least: float, sign: float) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals of a sphere's lower part up to the rim: from outside (sign 1) or inside (-1)."""
    height, turn = np.meshgrid(np.arange(bottom, FLOOR + RIM, 0.1), np.arange(0.0, 2.0 * np.pi, 0.01))
    z, turn = height.ravel(), turn.ravel()
    across = np.sqrt(radius**2 - (z - bottom - radius) ** 2)
    normals = np.column_stack([across * np.cos(turn), across * np.sin(turn), z - bottom - radius]) / radius
    points = radius * normals + [0.0, 0.0, bottom + radius]
    seen = across >= least
    return points[seen], sign * normals[seen]


def table() -> tuple[np.ndarray, np.ndarray]:
    points = np.stack(np.meshgrid(*[np.arange(-14.0, 14.0, 0.25)] * 2, [TABLE]), axis=-1).reshape(-1, 3)
    points = points[np.hypot(points[:, 0], points[:, 1]) >= FOOT]
    return points, np.tile([0.0, 0.0, 1.0], (len(points), 1))


def bowl_on_a_table() -> tuple[Voxels, np.ndarray]:
    """Voxels, and of which surface each is for the most part."""
    parts = cap(INNER, FLOOR, 0.0, -1.0), cap(OUTER, FLOOR - 0.8, FOOT, 1.0), table()
    points, normals = (np.concatenate([part[n] for part in parts]) for n in range(2))
    surface = np.repeat(np.arange(3), [len(part[0]) for part in parts])
    cells, cell = np.unique(np.floor(points).astype(np.int32), axis=0, return_inverse=True)
    cell, n = cell.ravel(), len(cells)
    sums = [np.stack([np.bincount(cell, x, n) for x in values.T], axis=1) for values in (points, normals)]
    count = np.bincount(cell, minlength=n)
    most = np.stack([np.bincount(cell, surface == s, n) for s in range(3)], axis=1).argmax(axis=1)
    p = np.array([[0.30, 0.25], [0.60, 0.05], [0.05, 0.60]])[most]  # the inside is the bowl's by a little
    voxels = Voxels(
        size=SIZE,
        cells=cells,
        points=sums[0] / count[:, None] * SIZE,
        colours=np.full((n, 3), 80.0, np.float32),
        normals=(sums[1] / np.linalg.norm(sums[1], axis=1, keepdims=True)).astype(np.float32),
        log_p=np.log(p).astype(np.float32),
        count=count.astype(np.int32),
        views=np.ones(n, np.int32),
    )
    return voxels, most


def floor_of(voxels: Voxels, surface: np.ndarray) -> np.ndarray:
    """(N,) whether a voxel is of the inside and low."""
    return (surface == INSIDE) & (voxels.points[:, 2] < 3.0 * SIZE)


def test_a_bowls_floor_is_not_the_tables() -> None:
    voxels, surface = bowl_on_a_table()
    floor, right = floor_of(voxels, surface), np.where(surface == AROUND, NO_OBJECT, BOWL)
    assert (label_voxels(voxels, MrfConfig()).label == right).all()
    paper = label_voxels(voxels, MrfConfig(normals_step=math.inf, concave_from=0.0)).label
    assert (paper[~floor] == right[~floor]).all()
    assert (paper[floor] == NO_OBJECT).mean() > 0.3


def test_a_bowls_floor_is_its_walls_where_its_own_evidence_denies_it() -> None:
    voxels, surface = bowl_on_a_table()
    floor, right = floor_of(voxels, surface), np.where(surface == AROUND, NO_OBJECT, BOWL)
    log_p = voxels.log_p.copy()
    log_p[floor] = np.log([0.02, 0.30])
    denied = replace(voxels, log_p=log_p)
    assert (label_voxels(denied, MrfConfig()).label == right).all()
    steps_alone = label_voxels(denied, MrfConfig(concave_from=0.0)).label
    assert (steps_alone[floor] == NO_OBJECT).mean() > 0.1
