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


@njit(cache=True, nogil=True, error_model="numpy")
def add_points(T, size, points, normals, colours, log_p, frame, table, ints, floats, used):  # pragma: no cover
    """Add P points; rows for all of them must be free.

    Much time goes into waiting for memory: places and rows of a batch are looked at first, which does not wait for one
    after the other. Loops within a batch call nothing that is given an array: numba counts an array's users in every
    such call, which took half the time of all.

    Args:
        T: (4, 4) T_anchor_camera; the voxels have the anchor's axes.
        size: metres.
        points, normals, colours: (P, 3) in camera axes, as `Surface` has them.
        log_p: (P, K + 1) log probabilities where all classes are kept, else (P, 0): they are for `add_some_classes`.
        frame: number of this one, from 1 on, for counting views.
        table: (2^n,) places of the hash table.
        ints, floats: (V, C) int32 and float32 views of the same rows; what free ones hold does not matter.
        used: rows that are taken.

    Returns:
        (P,) int32 rows of the points, the rows that are taken now, and what is not to be looked at.
    """
    rows, fetched = np.empty(len(points), np.int32), 0
    scaled = T[:3] / size
    cells, places = np.empty((BATCH, 3), np.int32), np.empty(BATCH, np.int64)
    sums = np.empty((BATCH, GEOMETRY + log_p.shape[1]), np.float32)
    for first in range(0, len(points), BATCH):
        last = min(first + BATCH, len(points))
        _locate(scaled, points[first:last], cells, places, sums, len(table) - 1)
        _describe(T, normals[first:last], colours[first:last], log_p[first:last], sums)
        fetched ^= _fetch(table, ints, places[: last - first])
        used = _find(table, ints, cells, places, used, rows[first:last])
        _add(ints, floats, sums, rows[first:last], frame)
    return rows, used, fetched


@njit(cache=True, nogil=True, error_model="numpy")
def _locate(scaled, points, cells, places, sums, mask):  # pragma: no cover
    """The cells of a batch's points, where they are in them, and where to look for them first."""
    for b in range(len(points)):
        x, y, z = points[b, 0], points[b, 1], points[b, 2]
        for axis in range(3):
            along = scaled[axis, 0] * x + scaled[axis, 1] * y + scaled[axis, 2] * z + scaled[axis, 3]
            cell = np.floor(along)
            cells[b, axis], sums[b, axis] = np.int32(cell), np.float32(along - cell)
        places[b] = _place(cells[b, 0], cells[b, 1], cells[b, 2], mask)


@njit(cache=True, nogil=True, error_model="numpy")
def _describe(T, normals, colours, log_p, sums):  # pragma: no cover
    """The rest of what is added to the rows of a batch's points."""
    for b in range(len(normals)):
        x, y, z = normals[b, 0], normals[b, 1], normals[b, 2]
        is_known = not np.isnan(x)
        for axis in range(3):
            sums[b, 3 + axis] = colours[b, axis]
            along = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z
            sums[b, 6 + axis] = along if is_known else 0.0
        for c in range(log_p.shape[1]):
            sums[b, GEOMETRY + c] = log_p[b, c]


@njit(cache=True, nogil=True)
def _place(i, j, k, mask):  # pragma: no cover
    """Where to look for a cell first.

    Cells next to each other lie all over the table. Blocks of 4 x 4 x 4 or 2 x 2 x 2 at places next to each other share
    its cache lines, but form chains (up to 45 places, not 3), and took a fifth longer in a room and no less at a table.
    """
    key = (np.int64(i) << np.int64(2 * KEY_BITS)) ^ (np.int64(j) << np.int64(KEY_BITS)) ^ np.int64(k)
    # the product's upper bits depend on all three axes, its lower ones only on the last
    return ((key * np.int64(-7046029254386353131)) >> np.int64(40)) & mask


@njit(cache=True, nogil=True)
def _fetch(table, ints, places):  # pragma: no cover
    """Look at the places, then at the first and the last of the rows that they hold."""
    fetched = 0
    for b in range(len(places)):
        fetched ^= table[places[b]]
    for b in range(len(places)):
        row = max(0, table[places[b]] - 1)
        fetched ^= ints[row, 0] ^ ints[row, -1]
    return fetched


@njit(cache=True, nogil=True)
def _find(table, ints, cells, places, used, rows):  # pragma: no cover
    """The `rows` of a batch's cells, from their places on; cells without one take the next that is free."""
    mask, first = len(table) - 1, used
    for b in range(len(rows)):
        i, j, k, place = cells[b, 0], cells[b, 1], cells[b, 2], places[b]
        row = np.int64(table[place]) - 1  # -1 where the place is free
        while row >= 0 and (ints[row, 0] != i or ints[row, 1] != j or ints[row, 2] != k):
            place = (place + 1) & mask
            row = np.int64(table[place]) - 1
        if row < 0:
            row = used
            ints[row, 0], ints[row, 1], ints[row, 2] = i, j, k
            used += 1
            table[place] = used
        rows[b] = row
    for row in range(first, used):
        for c in range(POINTS, ints.shape[1]):
            ints[row, c] = 0
    return used


@njit(cache=True, nogil=True)
def _add(ints, floats, sums, rows, frame):  # pragma: no cover
    for b in range(len(rows)):
        row = np.int64(rows[b])
        ints[row, POINTS] += 1
        ints[row, VIEWS] += ints[row, LAST_FRAME] != frame
        ints[row, LAST_FRAME] = frame
        for c in range(sums.shape[1]):
            floats[row, SUMS + c] += sums[b, c]


@njit(cache=True, nogil=True)
def fill_table(table, ints, used):  # pragma: no cover
    """Enter the first `used` rows, each of another cell, into an empty table."""
    mask = len(table) - 1
    for row in range(used):
        place = _place(ints[row, 0], ints[row, 1], ints[row, 2], mask)
        while table[place] != FREE:
            place = (place + 1) & mask
        table[place] = row + 1


@njit(cache=True, nogil=True)
def split_rows(ints, floats, cells, counts, sums, class_sums):  # pragma: no cover
    """Copy the first rows into arrays of their columns, in one pass: numpy's four take twice as long."""
    for row in range(len(cells)):
        for c in range(cells.shape[1]):
            cells[row, c] = ints[row, CELL + c]
        for c in range(counts.shape[1]):
            counts[row, c] = ints[row, POINTS + c]
        for c in range(sums.shape[1]):
            sums[row, c] = floats[row, SUMS + c]
        for c in range(class_sums.shape[1]):
            class_sums[row, c] = floats[row, CLASSES + c]
