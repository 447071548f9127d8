"""Submaps at their places in the world, merged where they overlap: equations (6) and (7) of Lai et al."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numba import njit

from ..trajectory.cloud import KEY_BITS, KEY_OFFSET
from .submap import FrozenSubmap

POINTS, VIEWS = range(2)  # counts of a submap's voxel
FLOOR, BACKGROUND, LOST, BOUND = range(4)  # its class sums where it keeps only some classes

LEAST_NORMAL = 1e-6  # of the mean of unit normals, below which it has no direction


@dataclass(frozen=True, slots=True, eq=False)
class Voxels:
    """N cells of the world with points in them, sorted by x, then y, then z, and what is known of each.

    Attributes:
        size: metres, a voxel's edge.
        cells: (N, 3) int32, x = floor(point / size).
        points: (N, 3) float64 metres, world: mean position of the points.
        colours: (N, 3) float32 mean RGB, 0 to 255.
        normals: (N, 3) float32 unit vectors, world, towards the cameras; NaN where none is known.
        log_p: (N, K + 1) float32, mean over the points of ln p(c | x), the background's last (eq. 7): the logarithm of
            the geometric mean of eq. (6).
        count: (N,) int32 points.
        views: (N,) int32 frames that saw it; never more than there were.
        log_p_error: (N,) float32 nats, by which `log_p` of a class (not the background's) may be off at most; None
            where voxels keep all classes and it is exact, rounding aside.
    """

    size: float
    cells: np.ndarray
    points: np.ndarray
    colours: np.ndarray
    normals: np.ndarray
    log_p: np.ndarray
    count: np.ndarray
    views: np.ndarray
    log_p_error: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.cells)


def merge(
    submaps: Callable[[], Iterable[FrozenSubmap]], T_world_keyframe: np.ndarray, size: float, classes: int
) -> Voxels:
    """Voxels of submaps fall into the cell of the world where their mean position is, and sums add.

    Memory: the result, about 60 bytes a voxel of the world beside it, and about 40 for each of all submaps.

    Args:
        submaps: goes through them, in the same order each time: it is called twice, so that one is in memory at once.
        T_world_keyframe: (M, 4, 4).
        size: metres, a voxel's edge, in submaps and in the world.
        classes: K.

    Raises:
        ValueError: a keyframe has no pose, or voxels lie farther than 2^20 cells from the origin.
    """
    keys = [_world_keys(_placed(submap, T_world_keyframe, size)[1], size) for submap in submaps()]
    if not keys:
        keys = [np.empty(0, np.int64)]
    cells, rows = np.unique(np.concatenate(keys), return_inverse=True)
    rows, ends = rows.astype(np.int32), np.cumsum([len(k) for k in keys])
    count = len(cells)
    points, colours, normals = np.zeros((count, 3)), np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32)
    log_p, common, bound = np.zeros((count, classes + 1), np.float32), np.zeros(count), np.zeros(count, np.float32)
    tally, latest = np.zeros((count, 2), np.int32), np.zeros((count, 2), np.int32)
    exact = True
    for number, submap in enumerate(submaps(), start=1):
        own = rows[ends[number - 1] - len(submap) : ends[number - 1]]
        R, positions = _placed(submap, T_world_keyframe, size)
        _add_geometry(own, positions, R, submap.counts, submap.sums, points, colours, normals)
        _add_counts(own, number, submap.counts, tally, latest)
        if (kept := submap.kept) is None:
            _add_all(own, submap.class_sums, log_p)
            continue
        exact = False
        _add_kept(own, submap.class_sums, kept.taken, kept.ids, kept.values, log_p, common, bound)
    n = tally[:, POINTS, None].astype(np.float32)
    log_p[:, :classes] += common[:, None].astype(np.float32)
    log_p /= n
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = np.where(length > LEAST_NORMAL * n, normals / length, np.float32(np.nan))
    return Voxels(
        size=size,
        cells=_cells(cells).astype(np.int32),
        points=points / n,
        colours=colours / n,
        normals=normals,
        log_p=log_p,
        count=tally[:, POINTS].copy(),
        views=tally[:, VIEWS].copy(),
        log_p_error=None if exact else bound / n[:, 0],
    )


def _placed(submap: FrozenSubmap, T_world_keyframe: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """R_world_anchor, and (V, 3) mean positions of voxels in the world, metres."""
    if not 0 <= submap.anchor < len(T_world_keyframe):
        raise ValueError(f"keyframe {submap.anchor} has no pose: T_world_keyframe has {len(T_world_keyframe)}")
    T = np.asarray(T_world_keyframe[submap.anchor], dtype=np.float64)
    R = np.ascontiguousarray(T[:3, :3])
    return R, (submap.cells + submap.sums[:, :3] / submap.counts[:, :1]) * size @ R.T + T[:3, 3]


def _world_keys(positions: np.ndarray, size: float) -> np.ndarray:
    cells = np.floor(positions / size)
    if len(cells) and not np.abs(cells).max() < KEY_OFFSET:  # of NaN too
        raise ValueError(f"voxels must lie within {KEY_OFFSET * size:.0f} m of the origin")
    i, j, k = cells.astype(np.int64).T + KEY_OFFSET
    return (i << (2 * KEY_BITS)) | (j << KEY_BITS) | k


def _cells(keys: np.ndarray) -> np.ndarray:
    """(V, 3) int64 cells of (V,) numbers."""
    axes = [(keys >> shift) & ((1 << KEY_BITS) - 1) for shift in (2 * KEY_BITS, KEY_BITS, 0)]
    return np.stack(axes, axis=1) - KEY_OFFSET


@njit(cache=True, nogil=True)
def _add_geometry(rows, positions, R, counts, sums, points, colours, normals):  # pragma: no cover
    for v in range(len(rows)):
        w = rows[v]
        for i in range(3):
            points[w, i] += counts[v, POINTS] * positions[v, i]
            colours[w, i] += sums[v, 3 + i]
            normals[w, i] += R[i, 0] * sums[v, 6] + R[i, 1] * sums[v, 7] + R[i, 2] * sums[v, 8]


@njit(cache=True, nogil=True)
def _add_counts(rows, number, counts, tally, latest):  # pragma: no cover
    """Points add; a frame is of one submap, but may have seen several of its voxels that fall into one cell: of those
    the greatest number of views counts."""
    for v in range(len(rows)):
        w = rows[v]
        tally[w, POINTS] += counts[v, POINTS]
        if latest[w, 0] != number:
            latest[w, 0], latest[w, 1] = number, 0
        if counts[v, VIEWS] > latest[w, 1]:
            tally[w, VIEWS] += counts[v, VIEWS] - latest[w, 1]
            latest[w, 1] = counts[v, VIEWS]


@njit(cache=True, nogil=True)
def _add_all(rows, class_sums, log_p):  # pragma: no cover
    for v in range(len(rows)):
        for c in range(log_p.shape[1]):
            log_p[rows[v], c] += class_sums[v, c]


@njit(cache=True, nogil=True)
def _add_kept(rows, class_sums, taken, ids, values, log_p, common, bound):  # pragma: no cover
    """Classes without a slot have the floor and an equal share of what was lost; that is added to all (`common`)."""
    classes, first = log_p.shape[1] - 1, 0
    for v in range(len(rows)):
        w, last = rows[v], first + taken[v]
        share = min(class_sums[v, LOST] / max(1, classes - taken[v]), class_sums[v, BOUND])
        common[w] += class_sums[v, FLOOR] + share
        bound[w] += class_sums[v, BOUND]
        log_p[w, classes] += class_sums[v, BACKGROUND]
        for u in range(first, last):
            log_p[w, ids[u]] += values[u] - share
        first = last
