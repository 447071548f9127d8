"""The loops that add a frame's points to a growing table of voxels.

A voxel's row is found by open addressing: `table` holds rows, which begin with their cells. What a row has of K classes
is in one of two forms, see `class_slots`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..trajectory.cloud import KEY_BITS

FREE = 0  # places of the table hold rows + 1, and slots classes + 1: memory that is not touched yet is zero
CELL, POINTS, VIEWS, LAST_FRAME, SUMS, CLASSES = 0, 3, 4, 5, 6, 15  # columns of a row: integers up to SUMS, then floats
GEOMETRY = CLASSES - SUMS  # sums: position in the cell (in its edges) 3, RGB 3, normal 3
BATCH = 512  # points whose rows are fetched together


@njit(cache=True, nogil=True)
def add_points(T, size, points, normals, colours, log_p, frame, table, ints, floats, used):  # pragma: no cover
    """Add P points; rows for all of them must be free.

    Nearly all time goes into waiting for memory: rows of a batch are looked at first, which does not wait for one
    after the other.

    Args:
        T: (4, 4) T_anchor_camera; the voxels have the anchor's axes.
        size: metres.
        points, normals, colours: (P, 3) in camera axes, as `Surface` has them.
        log_p: (P, K + 1) log probabilities where all classes are kept, else (P, 0): they are for `add_some_classes`.
        frame: number of this one, from 1 on, for counting views.
        table: (2^n,) places of the hash table.
        ints, floats: (V, C) int32 and float32 views of the same rows.
        used: rows that are taken.

    Returns:
        (P,) int32 rows of the points, the rows that are taken now, and what is not to be looked at.
    """
    rows, fetched = np.empty(len(points), np.int32), 0
    scaled = T[:3] / size
    cells, inside = np.empty((BATCH, 3), np.int32), np.empty((BATCH, 3), np.float32)
    for first in range(0, len(points), BATCH):
        last = min(first + BATCH, len(points))
        for p in range(first, last):
            x, y, z = _turned(scaled, points[p, 0], points[p, 1], points[p, 2])
            _split(x + scaled[0, 3], cells, inside, p - first, 0)
            _split(y + scaled[1, 3], cells, inside, p - first, 1)
            _split(z + scaled[2, 3], cells, inside, p - first, 2)
            rows[p] = _place(table, cells[p - first, 0], cells[p - first, 1], cells[p - first, 2])
            fetched ^= table[rows[p]]
        for p in range(first, last):
            row = max(0, table[rows[p]] - 1)
            fetched ^= ints[row, 0] ^ ints[row, -1]
        for p in range(first, last):
            b = p - first
            place = find(table, ints, rows[p], cells[b, 0], cells[b, 1], cells[b, 2])
            if table[place] == FREE:
                ints[used, 0], ints[used, 1], ints[used, 2] = cells[b, 0], cells[b, 1], cells[b, 2]
                used += 1
                table[place] = used
            row = np.int64(table[place]) - 1
            rows[p] = row
            ints[row, POINTS] += 1
            if ints[row, LAST_FRAME] != frame:
                ints[row, LAST_FRAME] = frame
                ints[row, VIEWS] += 1
            _add_three(floats, row, SUMS, inside[b, 0], inside[b, 1], inside[b, 2])
            _add_three(floats, row, SUMS + 3, colours[p, 0], colours[p, 1], colours[p, 2])
            if not np.isnan(normals[p, 0]):
                x, y, z = _turned(T, normals[p, 0], normals[p, 1], normals[p, 2])
                _add_three(floats, row, SUMS + 6, x, y, z)
            for c in range(log_p.shape[1]):
                floats[row, CLASSES + c] += log_p[p, c]
    return rows, used, fetched


@njit(cache=True, nogil=True)
def _turned(T, x, y, z):  # pragma: no cover
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z,
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z,
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z,
    )


@njit(cache=True, nogil=True)
def _split(x, cells, inside, b, axis):  # pragma: no cover
    cell = np.floor(x)
    cells[b, axis], inside[b, axis] = np.int32(cell), np.float32(x - cell)


@njit(cache=True, nogil=True)
def _add_three(floats, row, first, x, y, z):  # pragma: no cover
    floats[row, first] += np.float32(x)
    floats[row, first + 1] += np.float32(y)
    floats[row, first + 2] += np.float32(z)


@njit(cache=True, nogil=True)
def _place(table, i, j, k):  # pragma: no cover
    """Where to look for a cell first."""
    key = (np.int64(i) << np.int64(2 * KEY_BITS)) ^ (np.int64(j) << np.int64(KEY_BITS)) ^ np.int64(k)
    # the product's upper bits depend on all three axes, its lower ones only on the last
    return ((key * np.int64(-7046029254386353131)) >> np.int64(40)) & (len(table) - 1)


@njit(cache=True, nogil=True)
def find(table, ints, place, i, j, k):  # pragma: no cover
    """The place in the table of a cell, or the free one where it belongs, from `_place` on."""
    while table[place] != FREE:
        row = np.int64(table[place]) - 1
        if ints[row, 0] == i and ints[row, 1] == j and ints[row, 2] == k:
            break
        place = (place + 1) & (len(table) - 1)
    return place


@njit(cache=True, nogil=True)
def fill_table(table, ints, used):  # pragma: no cover
    """Enter the first `used` rows into an empty table."""
    for row in range(used):
        i, j, k = ints[row, 0], ints[row, 1], ints[row, 2]
        table[find(table, ints, _place(table, i, j, k), i, j, k)] = row + 1
