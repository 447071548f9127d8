"""The outline of an ellipsoid in the image: where it cuts a row of pixels, and its area.

A ray x * column + row from origin, in the coordinates where the ellipsoid is the unit ball, meets it where

    (d · o)^2 - (d · d) (o · o - 1) >= 0,      d = x * column + row,

a quadratic in x. The outline is the ellipse of the dual conic C = M - t t^T of `volume.py`; with the centre
c = C[:2, 2] / C33 its spread is S = c c^T - C[:2, :2] / C33, and its area pi sqrt(det S).
"""

from __future__ import annotations

import math

from numba import njit


@njit(cache=True)
def row_span(column, row, origin):
    """The interval of x in which the ray x * column + row from origin (3,) meets the unit ball; empty as (0, 0)."""
    outside, co, ro = _dot(origin, origin) - 1.0, _dot(column, origin), _dot(row, origin)
    a = co * co - outside * _dot(column, column)
    b = co * ro - outside * _dot(column, row)
    root = b * b - a * (ro * ro - outside * _dot(row, row))
    if root <= 0.0:
        return 0.0, 0.0
    return (b - math.sqrt(root)) / -a, (b + math.sqrt(root)) / -a


@njit(cache=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def outline_area(M, t):
    """Area of the outline in normalised image coordinates, from the spread M (3, 3) and centre t (3,) in the camera."""
    below = t[2] * t[2] - M[2, 2]
    u, v = (t[0] * t[2] - M[0, 2]) / below, (t[1] * t[2] - M[1, 2]) / below
    uu, vv = u * u - (t[0] * t[0] - M[0, 0]) / below, v * v - (t[1] * t[1] - M[1, 1]) / below
    uv = u * v - (t[0] * t[1] - M[0, 1]) / below
    return math.pi * math.sqrt(max(uu * vv - uv * uv, 0.0))
