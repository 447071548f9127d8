"""Compiled loops over places and points, through all views.

They are in one file because a cached function does not notice that one it calls in another file has changed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

MM_PER_M = 1000.0
OUT, HIDDEN, VISIBLE = 0, 1, 2  # `sight.Sight`


@njit(cache=True)
def _to_camera(T, x, y, z):
    """A point by a (3, 4) transform, coordinate by coordinate."""
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3],
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3],
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3],
    )


@njit(cache=True)
def _kept_pixel(u, step, size):
    """The nearest of `size` kept columns (or rows) to a pixel of the full image."""
    return min(max(int(np.floor(u / step + 0.5)), 0), size - 1)


@njit(cache=True)
def see_places(places, T_camera_world, camera, step, depth_mm, margin, far, hidden, reach):
    """(T, V) `Sight` of places (T, 3) in V views, as `sight.sight` has it; the window reaches `reach` kept pixels."""
    views, height, width = depth_mm.shape
    result = np.full((len(places), views), OUT, dtype=np.int8)
    readings = np.empty((2 * reach + 1) ** 2)
    u_margin, v_margin = margin * camera[4], margin * camera[5]
    for t in range(len(places)):
        for view in range(views):
            x, y, z = _to_camera(T_camera_world[view], places[t, 0], places[t, 1], places[t, 2])
            if z <= 0.0 or z > far:
                continue
            u, v = camera[0] * x / z + camera[2], camera[1] * y / z + camera[3]
            if not (
                u_margin - 0.5 <= u <= camera[4] - 0.5 - u_margin and v_margin - 0.5 <= v <= camera[5] - 0.5 - v_margin
            ):
                continue
            column = _kept_pixel(u, step, width)
            row = _kept_pixel(v, step, height)
            count = 0
            for j in range(max(row - reach, 0), min(row + reach + 1, height)):
                for i in range(max(column - reach, 0), min(column + reach + 1, width)):
                    if depth_mm[view, j, i] > 0:
                        readings[count] = depth_mm[view, j, i]
                        count += 1
            if count == 0 or np.median(readings[:count]) / MM_PER_M < z - hidden:
                result[t, view] = HIDDEN
            else:
                result[t, view] = VISIBLE
    return result


@njit(cache=True)
def vote_for_points(points, T_camera_world, camera, step, depth_mm, votes, classes, same_surface):
    """(M,) classes that points (M, 3) win, -1 for none; `votes` (V, h, w) are those of the kept pixels."""
    views, height, width = depth_mm.shape
    winners = np.full(len(points), -1, dtype=np.int64)
    count = np.zeros(classes + 1, dtype=np.int64)  # the last for no object, whose -1 leads there
    for p in range(len(points)):
        count[:] = 0
        for view in range(views):
            x, y, z = _to_camera(T_camera_world[view], points[p, 0], points[p, 1], points[p, 2])
            if z <= 0.0:
                continue
            u, v = camera[0] * x / z + camera[2], camera[1] * y / z + camera[3]
            if not (-0.5 <= u < camera[4] - 0.5 and -0.5 <= v < camera[5] - 0.5):
                continue
            row, column = _kept_pixel(v, step, height), _kept_pixel(u, step, width)
            reading = depth_mm[view, row, column]
            if reading > 0 and abs(reading / MM_PER_M - z) <= same_surface:
                count[votes[view, row, column]] += 1
        for k in range(classes):
            most = count[winners[p]]  # at first of no object
            if count[k] > most:
                winners[p] = k
    return winners
