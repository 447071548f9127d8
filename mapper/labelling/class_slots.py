"""What a voxel has of K classes, held in one of two forms.

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

from .voxel_hash import CLASSES, FREE

FLOOR, BACKGROUND, LOST, BOUND = range(CLASSES, CLASSES + 4)  # columns from CLASSES on where voxels have slots


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
    excess = np.empty(classes, np.float32)  # of the classes of a point that are not accounted for yet, else 0
    floors, speaks = _floors(log_p)
    for p in range(len(rows)):
        row = np.int64(rows[p])
        floats[row, FLOOR] += floors[p]
        floats[row, BACKGROUND] += log_p[p, classes]
        if not speaks[p]:
            continue
        for c in range(classes):
            excess[c] = log_p[p, c] - floors[p]
        for s in range(ids.shape[1]):
            if ids[row, s] != FREE:
                c = ids[row, s] - 1
                values[row, s] += excess[c]
                excess[c] = 0.0
        _add_others(excess, floats[row], ids[row], values[row], before[row])


@njit(cache=True, nogil=True, fastmath=True)
def _floors(log_p):  # pragma: no cover
    """The least value of each point's classes, and whether there is any greater one."""
    floors, speaks = np.empty(len(log_p), np.float32), np.empty(len(log_p), np.bool_)
    for p in range(len(log_p)):
        least = greatest = log_p[p, 0]
        for c in range(1, log_p.shape[1] - 1):
            least, greatest = min(least, log_p[p, c]), max(greatest, log_p[p, c])
        floors[p], speaks[p] = least, greatest != least
    return floors, speaks


@njit(cache=True, nogil=True)
def _add_others(excess, floats, ids, values, before):  # pragma: no cover
    """The classes of a point that had no slot."""
    lost_before = floats[BOUND]
    greatest = _greatest(excess)
    while greatest > 0.0:
        at, least = 0, values[0] + before[0]
        for s in range(1, len(values)):
            if values[s] + before[s] < least:
                at, least = s, values[s] + before[s]
        if greatest + lost_before <= least:
            total = np.float32(0.0)
            for c in range(len(excess)):
                total += excess[c]
            floats[LOST] += total
            floats[BOUND] = max(floats[BOUND], greatest + lost_before)
            return
        best = 0
        while excess[best] != greatest:
            best += 1
        floats[LOST] += values[at]
        floats[BOUND] = max(floats[BOUND], least)
        ids[at], values[at], before[at] = best + 1, greatest, lost_before
        excess[best] = 0.0
        greatest = _greatest(excess)


@njit(cache=True, nogil=True, fastmath=True)
def _greatest(excess):  # pragma: no cover
    greatest = excess[0]
    for c in range(1, len(excess)):
        greatest = max(greatest, excess[c])
    return greatest
