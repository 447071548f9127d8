"""A depth image as a grid of camera-frame points, at a fraction of its resolution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from ...datasets.frame import Intrinsics

SAME_SURFACE = 0.03  # share of the depth within which readings of a square are averaged
NEIGHBOURS_TO_FILL = 3  # of the eight, for a point without a reading; closes the gaps that registration leaves
SPAN = 3  # points, half the width that normals are taken over: less, and noise tilts them, more, and they round edges
FLAT = 0.04  # share of the depth that a surface may rise or fall over `SPAN`


@dataclass(frozen=True, slots=True, eq=False)
class PointGrid:
    """One point for each square of `step` x `step` pixels.

    Attributes:
        points: (h, w, 3) float32 metres, camera axes; depth 0 where there is no reading.
        normals: (h, w, 3) float32 unit vectors towards the camera; zero where there is none.
        step: pixels.
        shape: (H, W) of the depth image.
    """

    points: np.ndarray
    normals: np.ndarray
    step: int
    shape: tuple[int, int]

    @property
    def depth(self) -> np.ndarray:
        """(h, w) float32 metres, 0 = no reading."""
        return self.points[..., 2]

    def enlarged(self, labels: np.ndarray) -> np.ndarray:
        """(h, w) values of the grid, one for each pixel: (H, W)."""
        big = np.repeat(np.repeat(labels, self.step, axis=0), self.step, axis=1)
        return big[: self.shape[0], : self.shape[1]]


def point_grid(depth: np.ndarray, intrinsics: Intrinsics, step: int, near: float, far: float) -> PointGrid:
    """The points of a depth image (H, W) in metres, of readings from `near` to `far`.

    A point's depth is the mean of its square's readings on the nearest surface. Squares without any take their
    neighbours': depth registered to another camera has gaps everywhere.
    """
    z = _fill(_reduced(np.ascontiguousarray(depth, dtype=np.float32), step, near, far))
    k = intrinsics
    u = (np.arange(z.shape[1], dtype=np.float32) * step + (step - 1) / 2 - k.cx) / k.fx
    v = (np.arange(z.shape[0], dtype=np.float32) * step + (step - 1) / 2 - k.cy) / k.fy
    points = np.empty((*z.shape, 3), dtype=np.float32)
    points[..., 0] = u * z
    points[..., 1] = v[:, None] * z
    points[..., 2] = z
    return PointGrid(points, _normals(points), step, (depth.shape[0], depth.shape[1]))


@njit(cache=True)
def _reduced(depth, step, near, far):  # pragma: no cover
    height, width = depth.shape
    rows, columns = (height + step - 1) // step, (width + step - 1) // step
    out = np.zeros((rows, columns), dtype=np.float32)
    for r in range(rows):
        for c in range(columns):
            nearest = far + 1.0
            for y in range(r * step, min(height, (r + 1) * step)):
                for x in range(c * step, min(width, (c + 1) * step)):
                    z = depth[y, x]
                    if near <= z <= far and z < nearest:
                        nearest = z
            total, count = 0.0, 0
            for y in range(r * step, min(height, (r + 1) * step)):
                for x in range(c * step, min(width, (c + 1) * step)):
                    z = depth[y, x]
                    if near <= z <= far and z <= nearest * (1.0 + SAME_SURFACE):
                        total += z
                        count += 1
            if count > 0:
                out[r, c] = total / count
    return out


@njit(cache=True)
def _fill(depth):  # pragma: no cover
    rows, columns = depth.shape
    out = depth.copy()
    for r in range(rows):
        for c in range(columns):
            if depth[r, c] > 0.0:
                continue
            nearest, count = np.inf, 0
            for y in range(max(0, r - 1), min(rows, r + 2)):
                for x in range(max(0, c - 1), min(columns, c + 2)):
                    if depth[y, x] > 0.0:
                        count += 1
                        nearest = min(nearest, depth[y, x])
            if count < NEIGHBOURS_TO_FILL:
                continue
            total, count = 0.0, 0
            for y in range(max(0, r - 1), min(rows, r + 2)):
                for x in range(max(0, c - 1), min(columns, c + 2)):
                    if 0.0 < depth[y, x] <= nearest * (1.0 + SAME_SURFACE):
                        total += depth[y, x]
                        count += 1
            out[r, c] = total / count
    return out


@njit(cache=True)
def _normals(points):  # pragma: no cover
    """(h, w, 3) float32 unit normals towards the camera from differences over `SPAN`, of one side where depth jumps
    on the other; zero where it jumps on both."""
    rows, columns = points.shape[:2]
    out = np.zeros((rows, columns, 3), dtype=np.float32)
    a, b = np.empty(3), np.empty(3)
    for r in range(rows):
        for c in range(columns):
            z = points[r, c, 2]
            if z <= 0.0:
                continue
            ok = True
            for axis in range(2):
                d = a if axis == 0 else b
                ends = 0
                for k in range(3):
                    d[k] = 0.0
                for sign in (-1, 1):
                    y, x = r + sign * SPAN * axis, c + sign * SPAN * (1 - axis)
                    if 0 <= y < rows and 0 <= x < columns:
                        other = points[y, x]
                        if other[2] > 0.0 and abs(other[2] - z) < FLAT * z:
                            ends += 1
                            for k in range(3):
                                d[k] += sign * (other[k] - points[r, c, k])
                ok = ok and ends > 0
            if not ok:
                continue
            nx = a[1] * b[2] - a[2] * b[1]
            ny = a[2] * b[0] - a[0] * b[2]
            nz = a[0] * b[1] - a[1] * b[0]
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            if length == 0.0:
                continue
            if nx * points[r, c, 0] + ny * points[r, c, 1] + nz * z > 0.0:
                length = -length
            out[r, c, 0], out[r, c, 1], out[r, c, 2] = nx / length, ny / length, nz / length
    return out
