"""Which voxels touch: the 26-neighbourhood of Lai et al., section IV-A, as pairs of voxels."""

from __future__ import annotations

import numpy as np
from numba import njit

_KEYS = 2**62
"""Cells of the grid around the voxels, at most: one 64-bit number names each."""


def neighbour_pairs(voxels: np.ndarray) -> np.ndarray:
    """Pairs of voxels that share a face, an edge or a corner, each once.

    Runs through the sorted voxels with one finger for each of 13 directions (the other 13 are the same pairs from the
    other side), in linear time after sorting.

    Args:
        voxels: (N, 3) integer indices of cells, in any order. Sorted ones (x, then y, then z) make the pairs, and all
            that is computed on them, run through memory in order.

    Returns:
        (E, 2) int32 rows of `voxels`, the lower first, sorted.

    Raises:
        ValueError: of another shape, a voxel comes twice, or they lie too far apart (2^62 cells in their box).
    """
    if voxels.ndim != 2 or voxels.shape[1] != 3 or voxels.dtype.kind not in "iu":
        raise ValueError(f"voxels must be integers of shape (N, 3), but are {voxels.dtype} of shape {voxels.shape}")
    if len(voxels) == 0:
        return np.empty((0, 2), np.int32)
    low = voxels.min(axis=0).astype(np.int64)
    extent = [int(n) + 3 for n in voxels.max(axis=0).astype(np.int64) - low]  # a free cell at each side of every row
    if extent[0] * extent[1] * extent[2] >= _KEYS:
        raise ValueError(f"voxels must lie in a box of fewer than 2^62 cells, but theirs is {extent}")
    strides = np.array([extent[1] * extent[2], extent[2], 1])
    keys = (voxels - low) @ strides
    order = np.argsort(keys, kind="stable").astype(np.int32)
    keys = keys[order]
    if (twice := np.flatnonzero(keys[1:] == keys[:-1])).size:
        raise ValueError(f"voxel {voxels[order[twice[0]]].tolist()} comes more than once")
    pairs = _pairs(keys, order, _forward(strides))
    if np.array_equal(order, np.arange(len(order))):
        return pairs  # found in order already
    return pairs[np.argsort(pairs[:, 0].astype(np.int64) * len(voxels) + pairs[:, 1], kind="stable")]


def _forward(strides: np.ndarray) -> np.ndarray:
    """(13,) differences of keys to the neighbours that come later, ascending."""
    steps = np.indices((3, 3, 3)).reshape(3, -1).T - 1
    differences = steps @ strides
    return np.sort(differences[differences > 0])


@njit(cache=True)
def _pairs(keys: np.ndarray, order: np.ndarray, differences: np.ndarray) -> np.ndarray:
    fingers = np.zeros(len(differences), np.int64)
    room = 6 * len(keys)
    pairs = np.empty((room, 2), np.int32)
    count = 0
    for s in range(len(keys)):
        if count + len(differences) > room:
            room = 2 * room + len(differences)
            more = np.empty((room, 2), np.int32)
            more[:count] = pairs[:count]
            pairs = more
        for d in range(len(differences)):
            wanted, t = keys[s] + differences[d], fingers[d]
            while t < len(keys) and keys[t] < wanted:
                t += 1
            fingers[d] = t
            if t < len(keys) and keys[t] == wanted:
                pairs[count, 0], pairs[count, 1] = min(order[s], order[t]), max(order[s], order[t])
                count += 1
    return pairs[:count].copy()
