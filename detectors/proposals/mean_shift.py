"""Flat-kernel mean shift (Comaniciu and Meer, PAMI 2002) on points binned into voxels.

Every voxel stands for the points in it, at their mean and weighted by their count, so that the modes are those of the
points. From each voxel the mean within the radius is followed until it stops; a way that comes into a voxel whose own
way is known goes on as that one. Modes nearer to each other than a radius are one, that of the most points.
"""

from __future__ import annotations

import numpy as np
from numba import njit

MOST_STEPS = 100
STOPPED = 1e-2  # of the radius: a shorter step is the last
UNKNOWN, NONE = -2, -1


def mean_shift(points: np.ndarray, radius: float, voxels_per_radius: int = 4) -> np.ndarray:
    """Clusters of points.

    Args:
        points: (N, 3), metres or any unit.
        radius: of the kernel.
        voxels_per_radius: fineness of the voxels.

    Returns:
        (N,) int32 cluster of each point, numbered from 0 by falling number of points at the mode. The same points give
        the same clusters.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=np.int32)
    points = np.ascontiguousarray(points, dtype=np.float64)
    low = points.min(axis=0)
    voxel = radius / voxels_per_radius
    index = ((points - low) / voxel).astype(np.int64)
    sides = index.max(axis=0) + 1
    key = (index[:, 0] * sides[1] + index[:, 1]) * sides[2] + index[:, 2]
    keys, inverse, count = np.unique(key, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(inverse, points[:, k]) for k in range(3)], axis=1) / count[:, None]

    cells = _index_of(keys, sides) // voxels_per_radius
    cell_sides = cells.max(axis=0) + 1
    cell = (cells[:, 0] * cell_sides[1] + cells[:, 1]) * cell_sides[2] + cells[:, 2]
    order = np.argsort(cell, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=int(np.prod(cell_sides))))])
    voxels, weights = means[order] - low, count[order].astype(np.float64)
    modes, mass, mode_of = _follow(voxels, weights, keys[order], starts, cell_sides, sides, radius, voxel)
    cluster_of_mode = _joined(modes, mass, radius)
    of_voxel = np.empty(len(keys), dtype=np.int32)
    of_voxel[order] = cluster_of_mode[mode_of]
    return of_voxel[inverse.reshape(-1)]


def _index_of(keys: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """(M, 3) voxel indices of (M,) row-major keys."""
    return np.stack([keys // (sides[1] * sides[2]), keys // sides[2] % sides[1], keys % sides[2]], axis=1)


@njit(cache=True)
def _follow(voxels, weights, keys, starts, cell_sides, sides, radius, voxel):  # pragma: no cover
    """(K, 3) modes, (K,) their weights, (M,) int32 mode of each voxel; voxels are sorted by cell of one radius."""
    count = len(voxels)
    key_order = np.argsort(keys, kind="mergesort")
    sorted_keys = keys[key_order]
    mode_of = np.full(count, UNKNOWN, dtype=np.int32)
    modes, mass = np.empty((count, 3)), np.empty(count)
    found = 0
    way = np.empty(MOST_STEPS + 1, dtype=np.int64)
    for start in range(count):
        if mode_of[start] != UNKNOWN:
            continue
        x, y, z = voxels[start]
        way[0], length, mode = start, 1, NONE
        weight = 0.0
        for _ in range(MOST_STEPS):
            sx, sy, sz, weight = _sums(x, y, z, voxels, weights, starts, cell_sides, radius)
            nx, ny, nz = sx / weight, sy / weight, sz / weight
            step = (nx - x) ** 2 + (ny - y) ** 2 + (nz - z) ** 2
            x, y, z = nx, ny, nz
            if step < (STOPPED * radius) ** 2:
                break
            key = (np.int64(x / voxel) * sides[1] + np.int64(y / voxel)) * sides[2] + np.int64(z / voxel)
            at = np.searchsorted(sorted_keys, key)
            if at < count and sorted_keys[at] == key:
                there = key_order[at]
                if mode_of[there] >= 0:
                    mode = mode_of[there]
                    break
                way[length] = there
                length += 1
        if mode == NONE:
            for k in range(found):
                if (modes[k, 0] - x) ** 2 + (modes[k, 1] - y) ** 2 + (modes[k, 2] - z) ** 2 < (0.1 * radius) ** 2:
                    mode = k
                    break
        if mode == NONE:
            modes[found, 0], modes[found, 1], modes[found, 2], mass[found] = x, y, z, weight
            mode = found
            found += 1
        for k in range(length):
            if mode_of[way[k]] == UNKNOWN:
                mode_of[way[k]] = mode
    return modes[:found], mass[:found], mode_of


@njit(cache=True)
def _sums(x, y, z, voxels, weights, starts, cell_sides, radius):  # pragma: no cover
    """Weighted sums of the voxels within the radius of a point, and their weight."""
    cx, cy, cz = int(x / radius), int(y / radius), int(z / radius)
    sx = sy = sz = total = 0.0
    near = radius * radius
    low_z, high_z = max(0, cz - 1), min(cell_sides[2] - 1, cz + 1)
    for a in range(max(0, cx - 1), min(cell_sides[0], cx + 2)):
        for b in range(max(0, cy - 1), min(cell_sides[1], cy + 2)):
            row = (a * cell_sides[1] + b) * cell_sides[2]
            for k in range(starts[row + low_z], starts[row + high_z + 1]):
                dx, dy, dz = voxels[k, 0] - x, voxels[k, 1] - y, voxels[k, 2] - z
                if dx * dx + dy * dy + dz * dz <= near:
                    w = weights[k]
                    sx += w * voxels[k, 0]
                    sy += w * voxels[k, 1]
                    sz += w * voxels[k, 2]
                    total += w
    return sx, sy, sz, total


@njit(cache=True)
def _joined(modes, mass, radius):  # pragma: no cover
    """(K,) int32 cluster of each mode: the heaviest mode takes all within the radius, then the heaviest left."""
    order = np.argsort(-mass, kind="mergesort")
    out = np.full(len(modes), NONE, dtype=np.int32)
    found = 0
    for i in order:
        if out[i] != NONE:
            continue
        for j in order:
            if out[j] == NONE:
                d = (modes[i] - modes[j]) ** 2
                if d.sum() <= radius * radius:
                    out[j] = found
        found += 1
    return out
