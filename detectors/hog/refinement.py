"""Probability spread from the middle of a box over what is near it in space (Lai et al. 2012, eq. 12)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from ...datasets.frame import Frame
from .score_vectors import LEAST


@dataclass(frozen=True, slots=True, eq=False)
class ClassBoxes:
    """Boxes of whole objects: class_id (N,), xyxy (N, 4) pixels clipped to the image, probability (N,)."""

    class_id: np.ndarray
    xyxy: np.ndarray
    probability: np.ndarray


def refine(p: np.ndarray, frame: Frame, found: ClassBoxes, gamma: float) -> None:
    """Change the maps of classes inside of the boxes of each.

        p(c | x) = p(box) exp(-gamma |x - x0|^2),   x in the box

    x are the points of the box's pixels, x0 the one at its centre, metres. Where the centre has no reading, its depth
    is the median of those in the middle of the box (half its sides), and a box without any there is left out. Where
    boxes of a class overlap the greatest value counts; pixels without a reading keep the probability they had.

    Args:
        p: (K, H, W) float32, changed.
        frame: for depth and intrinsics; one whose depth is not of the image's size changes nothing.
        found: boxes.
        gamma: 1/m^2.
    """
    depth, K = frame.depth, frame.intrinsics
    if depth.shape != p.shape[1:]:
        return
    for k in range(len(p)):
        own = found.class_id == k
        if own.any():
            boxes = np.ascontiguousarray(found.xyxy[own], dtype=np.float64)
            values = found.probability[own].astype(np.float64)
            _spread(p[k], depth, K.fx, K.fy, K.cx, K.cy, boxes, values, gamma)


@njit(cache=True)
def _spread(p, depth, fx, fy, cx, cy, boxes, values, gamma) -> None:
    height, width = depth.shape
    is_set = np.zeros((height, width), dtype=np.bool_)
    for n in range(len(boxes)):
        # Pixels whose centre the box contains; boxes count from the image's outer edge, half a pixel before them.
        x0, y0 = max(int(np.ceil(boxes[n, 0] - 0.5)), 0), max(int(np.ceil(boxes[n, 1] - 0.5)), 0)
        x1, y1 = min(int(np.floor(boxes[n, 2] - 0.5)), width - 1), min(int(np.floor(boxes[n, 3] - 0.5)), height - 1)
        if x1 < x0 or y1 < y0:
            continue
        u, v = (x0 + x1) / 2.0, (y0 + y1) / 2.0
        z = _depth_of_middle(depth[y0 : y1 + 1, x0 : x1 + 1])
        if z == 0.0:
            continue
        middle_x, middle_y = (u - cx) * z / fx, (v - cy) * z / fy
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                d = depth[y, x]
                if not _is_reading(d):
                    continue
                away = (d - z) ** 2 + ((x - cx) * d / fx - middle_x) ** 2 + ((y - cy) * d / fy - middle_y) ** 2
                value = min(max(values[n] * np.exp(-gamma * away), LEAST), 1.0 - LEAST)
                p[y, x] = max(p[y, x], value) if is_set[y, x] else value
                is_set[y, x] = True


@njit(cache=True)
def _depth_of_middle(depth) -> float:
    """Metres, of the middle pixel of a box, or the median of the middle's readings; 0 without any."""
    rows, columns = depth.shape
    middle = depth[(rows - 1) // 2, (columns - 1) // 2]
    if _is_reading(middle):
        return float(middle)
    around = depth[rows // 4 : rows - rows // 4, columns // 4 : columns - columns // 4].copy().ravel()
    count = 0
    for value in around:
        if _is_reading(value):
            around[count] = value
            count += 1
    return float(np.median(around[:count])) if count else 0.0


@njit(cache=True)
def _is_reading(depth) -> bool:
    return depth > 0.0 and depth < np.inf
