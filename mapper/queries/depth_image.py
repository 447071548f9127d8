"""The depth image that a camera would take of a map: its cloud as splats, its things as the ellipsoids in their boxes.

A point of a cloud of one point a voxel stands for a surface as wide as a voxel, so it is drawn as a square of
f * spacing / z pixels, and the nearest wins. Where nothing is drawn, nothing is known to be in the way: such pixels
are `CLEAR`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ...datasets.frame import Intrinsics
from ...factors.volume import NEAR_MARGIN_M, camera_quadric, project_kernel

CLEAR = np.float32(1e3)  # metres: farther than any room, so it hides nothing


def empty_depth(camera: Intrinsics) -> np.ndarray:
    """(H, W) float32 metres, in which nothing is in the way."""
    return np.full((camera.height, camera.width), CLEAR, dtype=np.float32)


def draw_points(
    depth: np.ndarray, points: np.ndarray, spacing: float, T_world_camera: np.ndarray, camera: Intrinsics
) -> None:
    """Draw (M, 3) float32 points, metres, map frame, that stand for `spacing` metres each, into (H, W) depth."""
    T_camera_world = np.linalg.inv(T_world_camera)
    _draw_points(depth, points, float(spacing), np.ascontiguousarray(T_camera_world[:3]), _numbers(camera))


def draw_ellipsoids(
    depth: np.ndarray,
    centers: np.ndarray,
    log_half_axes: np.ndarray,
    axes: np.ndarray,
    T_world_camera: np.ndarray,
    camera: Intrinsics,
) -> None:
    """Draw N ellipsoids into (H, W) depth; those that are not wholly in front of the camera are left out.

    Args:
        depth: metres, drawn into.
        centers: (N, 3) metres, map frame.
        log_half_axes: (N, 3) log of metres.
        axes: (N, 3, 3), columns are the ellipsoids' axes in map coordinates.
        T_world_camera: (4, 4).
        camera: of the depth image.
    """
    T = np.asfortranarray(T_world_camera, dtype=float)
    for center, size, R in zip(centers, log_half_axes, axes, strict=True):
        _draw_ellipsoid(depth, _numbers(camera), T, np.ascontiguousarray(R), center.copy(), size.copy())


def smaller(camera: Intrinsics, width: int) -> Intrinsics:
    """The same view in fewer pixels, at most about `width` across: for what needs no more."""
    k = max(math.ceil(camera.width / width), 1)
    centre = ((camera.cx + 0.5) / k - 0.5, (camera.cy + 0.5) / k - 0.5)
    return Intrinsics(max(camera.width // k, 1), max(camera.height // k, 1), camera.fx / k, camera.fy / k, *centre)


def _numbers(camera: Intrinsics) -> np.ndarray:
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy])


@njit(cache=True)
def _draw_points(depth, points, spacing, T, camera):
    height, width = depth.shape
    fx, fy, cx, cy = camera
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        at = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
        if not at > NEAR_MARGIN_M:  # "not >" also catches NaN
            continue
        u = fx * (T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]) / at + cx
        v = fy * (T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]) / at + cy
        # at least the pixel that it falls into
        wide, high = max(0.5 * fx * spacing / at, 0.5), max(0.5 * fy * spacing / at, 0.5)
        if u + wide < 0.0 or v + high < 0.0 or u - wide > width - 1.0 or v - high > height - 1.0:
            continue
        left, right = max(math.ceil(u - wide), 0), min(math.floor(u + wide), width - 1)
        top, bottom = max(math.ceil(v - high), 0), min(math.floor(v + high), height - 1)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                if at < depth[row, column]:
                    depth[row, column] = at


@njit(cache=True)
def _draw_ellipsoid(depth, camera, T, R, center, log_half_axes):
    """Where the ray q z first meets the unit ball about the camera's place o: |q z + o| = 1, in the ball's frame."""
    height, width = depth.shape
    fx, fy, cx, cy = camera
    xyxy, unused = np.empty(4), np.zeros((4, 12))
    if not project_kernel(T, R, center, log_half_axes, xyxy, unused, False):
        return
    A, M, t = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    camera_quadric(T, R, center, log_half_axes, A, M, t)
    to_ball = (A / np.exp(log_half_axes)).T.copy()
    o = -(to_ball @ t)
    outside = o @ o - 1.0
    left, right = max(math.ceil(fx * xyxy[0] + cx), 0), min(math.floor(fx * xyxy[2] + cx), width - 1)
    top, bottom = max(math.ceil(fy * xyxy[1] + cy), 0), min(math.floor(fy * xyxy[3] + cy), height - 1)
    for row in range(top, bottom + 1):
        b = (row - cy) / fy
        for column in range(left, right + 1):
            a = (column - cx) / fx
            qq, qo = 0.0, 0.0
            for i in range(3):
                q = to_ball[i, 0] * a + to_ball[i, 1] * b + to_ball[i, 2]
                qq += q * q
                qo += q * o[i]
            root = qo * qo - qq * outside
            if root >= 0.0:
                at = (-qo - math.sqrt(root)) / qq
                if at < depth[row, column]:
                    depth[row, column] = at
