"""The surface's normal at each voxel, from the voxels around it (Lai et al., section IV-A).

A voxel's own normal is the mean of a few pixels', and between neighbours on one surface they differ by 20 degrees, more
than the side of a cup turns from one to the next. Within the paper's radius there are a hundred voxels. But its 5.2 cm
are the size of a cup: the mean over all of them bends the table up long before it touches the cup, and leaves no crease
to cut along. So only those count that look the same way as the voxel itself: a plane's noise goes, and the two sides of
a crease stay apart.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

LEAST = 1e-6  # of a sum of unit normals, below which it has no direction
_KEYS = 2**62  # cells of the grid around the voxels, at most: one 64-bit number names each


def surface_normals(cells: np.ndarray, normals: np.ndarray, radius: float, agreement: float) -> np.ndarray:
    """The mean of the normals n_j with |i - j| <= radius and n_i . n_j > agreement, made a unit vector again.

    Where n_i is not known it is the mean of all within the radius. They point outwards as the voxels' own do.

    Args:
        cells: (N, 3) integer indices of voxels, each once, in any order.
        normals: (N, 3) unit vectors, outwards; zero or NaN where unknown.
        radius: in edges of a voxel; with less than 1 each keeps its own.
        agreement: cosine of an angle; -1 or less takes all.

    Returns:
        (N, 3) float32; NaN where none is known within the radius.

    Raises:
        ValueError: voxels lie too far apart (2^62 cells in their box).
    """
    if len(cells) == 0:
        return np.empty((0, 3), np.float32)
    reach = math.floor(radius)
    low = cells.min(axis=0).astype(np.int64)
    extent = [int(n) + 2 * reach + 2 for n in cells.max(axis=0).astype(np.int64) - low]  # no row runs into the next
    if extent[0] * extent[1] * extent[2] >= _KEYS:
        raise ValueError(f"voxels must lie in a box of fewer than 2^62 cells, but theirs is {extent}")
    strides = np.array([extent[1] * extent[2], extent[2], 1])
    keys = (cells - low) @ strides
    order = np.argsort(keys, kind="stable")
    known = np.nan_to_num(np.asarray(normals, np.float32))[order]
    result = np.empty((len(cells), 3), np.float32)
    result[order] = _means(keys[order], known, *_columns(reach, radius, strides), agreement)
    return result


def _columns(reach: int, radius: float, strides: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The ball as columns along the last axis: (C,) differences of keys to their middles, and (C,) half lengths."""
    across = np.indices((2 * reach + 1, 2 * reach + 1)).reshape(2, -1).T - reach
    rest = radius**2 - (across**2).sum(axis=1)
    across, rest = across[rest >= 0.0], rest[rest >= 0.0]
    return across @ strides[:2], np.floor(np.sqrt(rest)).astype(np.int64)


@njit(cache=True)
def _means(keys, normals, middles, halves, agreement) -> np.ndarray:  # pragma: no cover
    """A finger for each column stays at its first voxel: both go through the sorted keys once."""
    count, result = len(keys), np.empty((len(keys), 3), np.float32)
    fingers = np.zeros(len(middles), np.int64)
    for s in range(count):
        own_x, own_y, own_z = normals[s]
        is_known = own_x != 0.0 or own_y != 0.0 or own_z != 0.0
        x = y = z = 0.0
        for c in range(len(middles)):
            t, last = fingers[c], keys[s] + middles[c] + halves[c]
            while t < count and keys[t] < last - 2 * halves[c]:
                t += 1
            fingers[c] = t
            while t < count and keys[t] <= last:
                other_x, other_y, other_z = normals[t]
                if not is_known or own_x * other_x + own_y * other_y + own_z * other_z > agreement:
                    x, y, z = x + other_x, y + other_y, z + other_z
                t += 1
        length = np.sqrt(x * x + y * y + z * z)
        if length > LEAST:
            result[s, 0], result[s, 1], result[s, 2] = x / length, y / length, z / length
        else:
            result[s] = np.nan
    return result
