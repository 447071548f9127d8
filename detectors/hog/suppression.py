"""Non-maximum suppression, first of each class by itself, then across classes.

Across classes because a mapper wants one box per object with its whole score vector: one mug seen as "cup" and as
"bowl" is one piece of evidence about one object, whose class is settled over many views. With a box for each class it
would have two objects standing in each other. The price: of two real objects whose boxes nearly coincide, one is missed
in that view. The classes' scores can be compared since they are probabilities by then (Lai et al. 2012, eq. 3).

Each class by itself first, so that a class's second-best window on an object goes with its best one, instead of
surviving where only the best one gives way to another class. Parts are detectors of their own and never suppress each
other.
"""

from __future__ import annotations

import numpy as np
from numba import njit


def suppress(xyxy: np.ndarray, group: np.ndarray, iou: float, most: int) -> np.ndarray:
    """Indices (M,) of the boxes that stay, in order.

    Args:
        xyxy: (N, 4) boxes, best first.
        group: (N,) whole numbers from 0; only boxes of one group suppress each other.
        iou: intersection over union above which the lesser box goes.
        most: how many boxes of a group stay at most.
    """
    if not len(xyxy):
        return np.zeros(0, dtype=np.int64)
    boxes, groups = np.ascontiguousarray(xyxy, dtype=np.float64), np.ascontiguousarray(group, dtype=np.int64)
    return np.flatnonzero(_stays(boxes, groups, float(iou), min(int(most), len(boxes))))


@njit(cache=True)
def _stays(boxes: np.ndarray, group: np.ndarray, iou: float, most: int) -> np.ndarray:
    stays = np.zeros(len(boxes), dtype=np.bool_)
    kept = np.empty((group.max() + 1, most), dtype=np.int64)
    counts = np.zeros(len(kept), dtype=np.int64)
    for n in range(len(boxes)):
        g = group[n]
        if counts[g] == most:
            continue
        free = True
        for k in range(counts[g]):
            if overlap(boxes[n], boxes[kept[g, k]]) > iou:
                free = False
                break
        if free:
            kept[g, counts[g]] = n
            counts[g] += 1
            stays[n] = True
    return stays


@njit(cache=True)
def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union of two (4,) boxes; 0 where neither has an area."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0.0 or height <= 0.0:
        return 0.0
    inner = width * height
    return inner / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - inner)
