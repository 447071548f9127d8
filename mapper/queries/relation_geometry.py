"""Plane geometry of two upright boxes, one pair at a time, compiled.

Everything is in the axes of the second box, whose centre is the origin: (dx, dy, dz) is the centre of the first,
(cosine, sine) its yaw there; (ax, ay, az) are half extents of the first, (bx, by, bz) of the second. Metres.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

CELLS = 7  # a side: a footprint is cut into 49 cells, so that shares are known to about a hundredth


@njit(cache=True)
def is_over(dx: float, dy: float, bx: float, by: float) -> bool:
    """Whether the point is over the second footprint."""
    return abs(dx) <= bx and abs(dy) <= by


@njit(cache=True)
def is_under_first(dx: float, dy: float, cosine: float, sine: float, ax: float, ay: float) -> bool:
    """Whether the second centre is over the first footprint."""
    return abs(cosine * dx + sine * dy) <= ax and abs(cosine * dy - sine * dx) <= ay


@njit(cache=True)
def shared_height(dz: float, az: float, bz: float) -> float:
    """Height that both boxes take up, 0 where one is above the other."""
    return max(min(dz + az, bz) - max(dz - az, -bz), 0.0)


@njit(cache=True)
def shared_footprint(
    dx: float, dy: float, cosine: float, sine: float, ax: float, ay: float, bx: float, by: float
) -> float:
    """Share of the first footprint that is over the second, by cells."""
    inside = 0
    for i in range(CELLS):
        x = ax * ((2 * i + 1) / CELLS - 1.0)
        for j in range(CELLS):
            y = ay * ((2 * j + 1) / CELLS - 1.0)
            inside += is_over(dx + cosine * x - sine * y, dy + sine * x + cosine * y, bx, by)
    return inside / CELLS**2


@njit(cache=True)
def horizontal_gap(
    dx: float, dy: float, cosine: float, sine: float, ax: float, ay: float, bx: float, by: float
) -> float:
    """Distance between the footprints, 0 where they meet.

    Two rectangles meet unless a side of either parts them; then they are nearest at a corner of one of them.
    """
    c, s = abs(cosine), abs(sine)
    ex, ey = cosine * dx + sine * dy, cosine * dy - sine * dx  # the offset in the first's axes
    parted = abs(dx) > bx + ax * c + ay * s or abs(dy) > by + ax * s + ay * c
    parted = parted or abs(ex) > ax + bx * c + by * s or abs(ey) > ay + bx * s + by * c
    if not parted:
        return 0.0
    least = np.inf
    for i in (-1.0, 1.0):
        for j in (-1.0, 1.0):
            x, y = i * ax, j * ay
            beyond_x = max(abs(dx + cosine * x - sine * y) - bx, 0.0)
            beyond_y = max(abs(dy + sine * x + cosine * y) - by, 0.0)
            least = min(least, beyond_x * beyond_x + beyond_y * beyond_y)
            x, y = i * bx, j * by
            beyond_x = max(abs(ex - cosine * x - sine * y) - ax, 0.0)
            beyond_y = max(abs(ey - cosine * y + sine * x) - ay, 0.0)
            least = min(least, beyond_x * beyond_x + beyond_y * beyond_y)
    return math.sqrt(least)
