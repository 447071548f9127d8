"""How much of two upright boxes is shared: exact volumes of intersection over union.

Two boxes that stand upright share a prism: the convex polygon in which their footprints overlap, times the overlap of
their heights (the measure of Song et al., SUN RGB-D). The polygon comes from clipping one rectangle by the four sides
of the other (Sutherland and Hodgman 1974), in double precision: OpenCV's single-precision intersections of rotated
rectangles can lose the whole overlap where sides nearly coincide, as those of good boxes do.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numba import njit

MAX_CORNERS = 16  # a rectangle clipped by four lines has at most 8; twice that for what rounding may add


def box_row(position: np.ndarray, size: np.ndarray, yaw: float, R_world_upright: np.ndarray) -> np.ndarray:
    """(7,) box in upright axes: centre (3,), full extents (3,) [m], yaw [rad]; the form of `volume_ious`.

    `position` (3,) is in world coordinates; `size` and `yaw` are as in `mapper.map.boxes`.
    """
    return np.array([*(R_world_upright.T @ position), *size, yaw], dtype=np.float64)


def box_rows(boxes: Iterable[tuple[np.ndarray, np.ndarray, float]], R_world_upright: np.ndarray) -> np.ndarray:
    """(N, 7) of N (position, size, yaw); see `box_row`."""
    return np.array([box_row(*box, R_world_upright) for box in boxes], dtype=np.float64).reshape(-1, 7)


def volume_iou(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union of two boxes (7,); see `volume_ious`."""
    return float(volume_ious(np.reshape(a, (1, 7)), np.reshape(b, (1, 7)))[0, 0])


def volume_ious(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Volume of intersection over volume of union, of all pairs.

    Args:
        a: (N, 7) boxes in upright axes, rows of `box_row`.
        b: (M, 7) the same.

    Returns:
        (N, M) in [0, 1]; 0 where neither box has a volume, NaN where a value of either is not finite.
    """
    result = np.empty((len(a), len(b)))
    _all_pairs(np.ascontiguousarray(a, dtype=np.float64), np.ascontiguousarray(b, dtype=np.float64), result)
    return result


@njit(cache=True)
def _all_pairs(a, b, result):
    for i in range(len(a)):
        for j in range(len(b)):
            if not (np.isfinite(a[i]).all() and np.isfinite(b[j]).all()):
                result[i, j] = np.nan
                continue
            low = max(a[i, 2] - a[i, 5] / 2.0, b[j, 2] - b[j, 5] / 2.0)
            high = min(a[i, 2] + a[i, 5] / 2.0, b[j, 2] + b[j, 5] / 2.0)
            shared = max(high - low, 0.0)
            if shared > 0.0:
                shared *= _footprint_overlap(a[i], b[j])
            union = a[i, 3] * a[i, 4] * a[i, 5] + b[j, 3] * b[j, 4] * b[j, 5] - shared
            result[i, j] = min(max(shared / union, 0.0), 1.0) if union > 0.0 else 0.0


@njit(cache=True)
def _footprint_overlap(a, b):
    """Area shared by the footprints of two boxes, m^2: b's rectangle in a's axes, cut by a's four sides."""
    polygon, cut = np.empty((MAX_CORNERS, 2)), np.empty((MAX_CORNERS, 2))
    cos_a, sin_a = np.cos(a[6]), np.sin(a[6])
    cos_d, sin_d = np.cos(b[6] - a[6]), np.sin(b[6] - a[6])
    dx, dy = b[0] - a[0], b[1] - a[1]
    x, y = cos_a * dx + sin_a * dy, cos_a * dy - sin_a * dx
    for k in range(4):  # counter-clockwise
        u = b[3] / 2.0 if k == 1 or k == 2 else -b[3] / 2.0
        v = b[4] / 2.0 if k >= 2 else -b[4] / 2.0
        polygon[k, 0], polygon[k, 1] = x + cos_d * u - sin_d * v, y + sin_d * u + cos_d * v
    count = 4
    for axis in range(2):
        for side in (-1.0, 1.0):
            count = _clip(polygon, count, axis, side, a[3 + axis] / 2.0, cut)
            polygon[:count] = cut[:count]
    twice = 0.0
    for k in range(1, count - 1):  # triangles about the first corner: nothing large cancels
        ux, uy = polygon[k, 0] - polygon[0, 0], polygon[k, 1] - polygon[0, 1]
        vx, vy = polygon[k + 1, 0] - polygon[0, 0], polygon[k + 1, 1] - polygon[0, 1]
        twice += ux * vy - uy * vx
    return max(twice / 2.0, 0.0)


@njit(cache=True)
def _clip(polygon, count, axis, side, limit, cut):
    """Fill `cut` with the part of the polygon where side * coordinate <= limit; returns its number of corners."""
    kept = 0
    for k in range(count):
        following = (k + 1) % count
        inside = limit - side * polygon[k, axis]
        next_inside = limit - side * polygon[following, axis]
        if inside >= 0.0:
            cut[kept] = polygon[k]
            kept += 1
        if (inside >= 0.0) != (next_inside >= 0.0):
            share = inside / (inside - next_inside)
            cut[kept] = polygon[k] + share * (polygon[following] - polygon[k])
            kept += 1
    return kept
