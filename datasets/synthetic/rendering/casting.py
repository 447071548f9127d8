"""Rays through pixels and what they hit first (Embree)."""

from __future__ import annotations

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numba import njit

from ...frame import Intrinsics

MISS = -1


class Caster:
    """Casts rays against one set of triangles.

    Args:
        corners: (T, 3, 3) float32 metres.
    """

    def __init__(self, corners: np.ndarray) -> None:
        self._scene = EmbreeScene(robust=False)
        self._mesh = TriangleMesh(self._scene, np.ascontiguousarray(corners, np.float32))

    def first_hit(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(N, 3) float32 rays to (N,) int32 triangle numbers, `MISS` where nothing is hit."""
        return self._scene.run(origins, directions)

    def blocked(self, origins: np.ndarray, directions: np.ndarray, reach: np.ndarray) -> np.ndarray:
        """(N,) bool: something lies within `reach` (N,) float32 times the direction's length."""
        return self._scene.run(origins, directions, dists=reach, query="OCCLUDED") != MISS


def pixel_rays(
    intrinsics: Intrinsics, T_world_camera: np.ndarray, corner: tuple[int, int], size: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Rays through the pixel centres of a rectangle, which may reach outside the image.

    Args:
        corner: column and row of the upper left pixel.
        size: width and height in pixels.

    Returns:
        (N, 3) float32 origins and directions in world axes, row by row. Directions have unit length along the
        optical axis, so that a ray's parameter is depth. A pixel's ray is the same whatever the rectangle.
    """
    camera = (intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy)
    directions = _directions(*camera, np.ascontiguousarray(T_world_camera[:3, :3], np.float64), *corner, *size)
    origins = np.empty_like(directions)
    origins[:] = T_world_camera[:3, 3]
    return origins, directions


@njit(cache=True, nogil=True)
def _directions(fx, fy, cx, cy, R, left, top, width, height):
    out = np.empty((height * width, 3), np.float32)
    for row in range(height):
        y = (top + row - cy) / fy
        for column in range(width):
            x = (left + column - cx) / fx
            k = row * width + column
            for axis in range(3):
                out[k, axis] = R[axis, 0] * x + R[axis, 1] * y + R[axis, 2]
    return out


@njit(cache=True, nogil=True)
def hit_depths(corners, triangle, origin, directions):
    """Depths at which rays from one point meet the planes of the triangles they hit.

    Args:
        corners: (T, 3, 3) float32 metres.
        triangle: (N,) int32 triangle numbers, or `MISS`.
        origin: (3,) float64 metres.
        directions: (N, 3) float32.

    Returns:
        (N,) float64 ray parameters; 0 where nothing is hit.
    """
    depth = np.zeros(triangle.size)
    for k in range(triangle.size):
        t = triangle[k]
        if t == MISS:
            continue
        px, py, pz = np.float64(corners[t, 0, 0]), np.float64(corners[t, 0, 1]), np.float64(corners[t, 0, 2])
        ax, ay, az = corners[t, 1, 0] - px, corners[t, 1, 1] - py, corners[t, 1, 2] - pz
        bx, by, bz = corners[t, 2, 0] - px, corners[t, 2, 1] - py, corners[t, 2, 2] - pz
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        slope = nx * directions[k, 0] + ny * directions[k, 1] + nz * directions[k, 2]
        if slope != 0.0:
            depth[k] = (nx * (px - origin[0]) + ny * (py - origin[1]) + nz * (pz - origin[2])) / slope
    return depth
