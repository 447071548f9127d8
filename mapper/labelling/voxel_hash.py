"""The loops that add a frame's points to a growing table of voxels.

A voxel's row is found by open addressing: `table` holds rows, `keys` the cell of each row as one number. What a voxel
has of K classes is held in one of two forms.

Few classes (no more than a voxel keeps): (K + 1) sums of ln p, the background's last. Exact.

Many classes: most frames say the same least value of most classes, so that only what exceeds the least value of a point
(its floor) is told apart, and of only S classes, in slots. The floors' sum, common to all classes, and the
background's are exact. A class has its excess v in a slot, and may have lost some before it got there, at most d. All
the others have lost at most D. A point adds to the v of the classes with a slot; of the others, while the one of the
greatest excess w there may have more by now than the least of the slots, w + D > v + d, it takes that slot (d = D), and
D becomes the v + d of the one that goes; when none does any more, D becomes w + D of the greatest that is left, if that
is more. (The Space-Saving algorithm of Metwally et al., 2005, for points that speak of many classes at once.) What was
lost in all is shared by the classes without a slot. Hence

    no class is off by more than D, in either direction;
    D = 0 as long as no more than S classes have any excess;
    D <= sum of all excesses / S, as all v + d together never exceed that sum, and D none of them;
    D <= sum over points of the greatest excess.

Divided by the number of points, D bounds the error of the mean ln p of equation (7), in nats.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..trajectory.cloud import KEY_BITS

FREE = 0  # places of the table hold rows + 1, and slots classes + 1: memory that is not touched yet is zero
CELL, POINTS, VIEWS, LAST_FRAME, SUMS, CLASSES = 0, 3, 4, 5, 6, 15  # columns of a row: integers up to SUMS, then floats
GEOMETRY = CLASSES - SUMS  # sums: position in the cell (in its edges) 3, RGB 3, normal 3
FLOOR, BACKGROUND, LOST, BOUND = range(CLASSES, CLASSES + 4)  # columns from CLASSES on where voxels have slots
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


@njit(cache=True, nogil=True)
def add_some_classes(rows, log_p, floats, ids, values, before):  # pragma: no cover
    """Add (P, K + 1) log probabilities where voxels have slots.

    Args:
        rows: (P,) of the points.
        log_p: (P, K + 1), the background's last.
        floats: (V, C) with the columns FLOOR, BACKGROUND, LOST and BOUND (D).
        ids: (V, S) classes + 1 in slots, the taken slots first, then FREE.
        values: (V, S) their excess since they are there (v); 0 in free ones.
        before: (V, S) what they can have lost before (d); 0 in free ones.
    """
    classes = log_p.shape[1] - 1
    done = np.full(classes, -1, np.int64)  # the last point whose excess of the class is accounted for
    for p in range(len(rows)):
        row = np.int64(rows[p])
        floor, greatest = _range(log_p[p, :classes])
        floats[row, FLOOR] += floor
        floats[row, BACKGROUND] += log_p[p, classes]
        if greatest == floor:
            continue
        for s in range(ids.shape[1]):
            if ids[row, s] != FREE:
                c = ids[row, s] - 1
                values[row, s] += log_p[p, c] - floor
                done[c] = p
        _add_others(p, log_p[p, :classes], floor, done, floats[row], ids[row], values[row], before[row])


@njit(cache=True, nogil=True, fastmath=True)
def _range(values):  # pragma: no cover
    least = greatest = values[0]
    for c in range(1, len(values)):
        least, greatest = min(least, values[c]), max(greatest, values[c])
    return least, greatest


@njit(cache=True, nogil=True)
def _add_others(p, log_p, floor, done, floats, ids, values, before):  # pragma: no cover
    """The classes of a point that had no slot."""
    lost_before = floats[BOUND]
    while True:
        greatest, total, best = np.float32(0.0), np.float32(0.0), -1
        for c in range(len(log_p)):
            if done[c] != p:
                excess = log_p[c] - floor
                total += excess
                if excess > greatest:
                    greatest, best = excess, c
        if best < 0:
            return
        at = np.argmin(values + before)
        least = values[at] + before[at]
        if greatest + lost_before <= least:
            floats[LOST] += total
            floats[BOUND] = max(floats[BOUND], greatest + lost_before)
            return
        floats[LOST] += values[at]
        floats[BOUND] = max(floats[BOUND], least)
        ids[at], values[at], before[at] = best + 1, greatest, lost_before
        done[best] = p
