"""An upright ellipsoid seen by a camera: its image box, and how the box moves with pose, position and size.

What an object hides, and how far away its surface should be, is that of the ellipsoid inscribed in its extents; a
detected box is compared with the fuller `solid.py`. The ellipsoid has its centre c and half-axes a = exp(s) along the
columns of `R_world_upright`. In the camera frame it has centre t = R_world_camera^T (c - p), axes A = R_world_camera^T
R_world_upright and spread M = A diag(a^2) A^T. Its dual quadric, the set of planes that touch it, projects to the dual
conic of its outline:

    C = P Q* P^T = M - t t^T,      and a line l of the image touches the outline  <=>  l^T C l = 0.

The vertical line x = u is l = (1, 0, -u), which leaves a quadratic in u whose two roots are the left and right sides
(rows work the same with C[1, :]):

    C33 u^2 - 2 C13 u + C11 = 0,   u = (t_x t_z - M13 -+ sqrt(d)) / (t_z^2 - M33)

with d = t_z^2 M11 + t_x^2 M33 - 2 t_x t_z M13 - (M11 M33 - M13^2), written so that nothing large cancels.

Jacobian. The plane through the camera centre with normal n = (1, 0, -u) touches the ellipsoid in the one point
x = t -+ M n / h, h = sqrt(n^T M n). Seen from the side, a small motion only matters along n, so the side moves as the
projection of that contact point would:  du = n^T dx / x_z. For the right tangent [rot, trans] of the pose
dx = x × w - v, for the centre dx = R_world_camera^T dc, and for the sizes n^T dx = -+ a_k^2 (n^T A_k)^2 / h ds_k.

Near the camera plane the sides run to infinity, so the ellipsoid must lie beyond `NEAR_MARGIN_M` as a whole. As x_z is
at least that, no Jacobian entry exceeds |n| max(|x|, |a|) / NEAR_MARGIN_M.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from ..datasets.frame import Intrinsics

NEAR_MARGIN_M = 0.1  # nearest point of an ellipsoid that counts as in front; depth cameras read nothing below 0.3 m


@dataclass(frozen=True, slots=True, eq=False)
class Projection:
    """Image box of one ellipsoid, in normalised image coordinates (pixels = f * value + c).

    Attributes:
        xyxy: (4,) left, top, right, bottom; not clipped to any image. NaN where not in front.
        J_pose: (4, 6) derivative by the right tangent [rot, trans] of T_world_camera. Zero where not in front.
        J_center: (4, 3) by the centre, per metre.
        J_size: (4, 3) by the log half-axes.
        in_front: whether the whole ellipsoid lies beyond `NEAR_MARGIN_M`.
    """

    xyxy: np.ndarray
    J_pose: np.ndarray
    J_center: np.ndarray
    J_size: np.ndarray
    in_front: bool


def project_volume(
    T_world_camera: np.ndarray, R_world_upright: np.ndarray, center: np.ndarray, log_half_axes: np.ndarray
) -> Projection:
    """Image box of an upright ellipsoid with its Jacobians (the module's equations).

    Args:
        T_world_camera: (4, 4).
        R_world_upright: (3, 3), columns are the ellipsoid's axes in world coordinates.
        center: (3,) metres, world frame.
        log_half_axes: (3,) log of metres, along the columns of `R_world_upright`.
    """
    return projection(project_kernel, T_world_camera, R_world_upright, center, log_half_axes)


def projection(
    kernel: Callable[..., bool],
    T_world_camera: np.ndarray,
    R_world_upright: np.ndarray,
    center: np.ndarray,
    log_half_axes: np.ndarray,
) -> Projection:
    """What a kernel such as `project_kernel` makes of one volume; arguments as of `project_volume`."""
    xyxy, J = np.empty(4), np.zeros((4, 12))
    # Kernels are compiled once, for the memory order of gtsam.Pose3.matrix().
    in_front = kernel(
        np.asfortranarray(T_world_camera, dtype=float),
        np.ascontiguousarray(R_world_upright, dtype=float),
        np.ascontiguousarray(center, dtype=float),
        np.ascontiguousarray(log_half_axes, dtype=float),
        xyxy,
        J,
        True,
    )
    return Projection(xyxy, J[:, :6], J[:, 6:9], J[:, 9:], bool(in_front))


def project_volumes(
    T_world_camera: np.ndarray,
    R_world_upright: np.ndarray,
    centers: np.ndarray,
    log_half_axes: np.ndarray,
    intrinsics: Intrinsics,
) -> tuple[np.ndarray, np.ndarray]:
    """Image boxes of N upright ellipsoids.

    Args:
        T_world_camera: (4, 4).
        R_world_upright: (3, 3), columns are the ellipsoids' axes in world coordinates.
        centers: (N, 3) metres, world frame.
        log_half_axes: (N, 3) log of metres.

    Returns:
        xyxy: (N, 4) pixels, not clipped to the image; NaN where the ellipsoid is not wholly in front of the camera.
        in_front: (N,) bool.
    """
    return in_pixels(_project_all, T_world_camera, R_world_upright, centers, log_half_axes, intrinsics)


def in_pixels(
    kernel: Callable[..., None],
    T_world_camera: np.ndarray,
    R_world_upright: np.ndarray,
    centers: np.ndarray,
    log_half_axes: np.ndarray,
    intrinsics: Intrinsics,
) -> tuple[np.ndarray, np.ndarray]:
    """What a kernel of many volumes makes of N; arguments and results as of `project_volumes`."""
    xyxy = np.empty((len(centers), 4))
    in_front = np.empty(len(centers), dtype=np.bool_)
    kernel(
        np.asfortranarray(T_world_camera, dtype=float),
        np.ascontiguousarray(R_world_upright, dtype=float),
        np.ascontiguousarray(centers, dtype=float).reshape(-1, 3),
        np.ascontiguousarray(log_half_axes, dtype=float).reshape(-1, 3),
        xyxy,
        in_front,
    )
    scale = np.array([intrinsics.fx, intrinsics.fy] * 2)
    return xyxy * scale + np.array([intrinsics.cx, intrinsics.cy] * 2), in_front


@njit(cache=True)
def camera_axes(T, R, center, A, t):
    """Fill axes A (3, 3) and centre t (3,) of a volume in the camera frame."""
    for i in range(3):
        t[i] = 0.0
        for k in range(3):
            t[i] += T[k, i] * (center[k] - T[k, 3])
            A[i, k] = T[0, i] * R[0, k] + T[1, i] * R[1, k] + T[2, i] * R[2, k]


@njit(cache=True)
def camera_quadric(T, R, center, log_half_axes, A, M, t):
    """Fill axes A (3, 3), spread M (3, 3) and centre t (3,) of an ellipsoid in the camera frame."""
    camera_axes(T, R, center, A, t)
    for i in range(3):
        for j in range(i + 1):
            M[i, j] = 0.0
            for k in range(3):
                M[i, j] += math.exp(2.0 * log_half_axes[k]) * A[i, k] * A[j, k]
            M[j, i] = M[i, j]


@njit(cache=True)
def project_kernel(T, R_world_upright, center, log_half_axes, xyxy, J, with_jacobian):
    """Fill xyxy (4,) and, if asked, J (4, 12) = [pose, centre, size]; False (NaN, zeros) where not in front."""
    A, M, t = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    camera_quadric(T, R_world_upright, center, log_half_axes, A, M, t)
    if not t[2] - math.sqrt(M[2, 2]) > NEAR_MARGIN_M:  # "not >" also catches NaN
        xyxy[:] = np.nan
        J[:] = 0.0
        return False
    below = t[2] * t[2] - M[2, 2]
    for axis in range(2):
        d = t[2] * t[2] * M[axis, axis] + t[axis] * t[axis] * M[2, 2] - 2.0 * t[axis] * t[2] * M[axis, 2]
        root = math.sqrt(max(d - M[axis, axis] * M[2, 2] + M[axis, 2] * M[axis, 2], 0.0))
        middle = t[axis] * t[2] - M[axis, 2]
        xyxy[axis] = (middle - root) / below
        xyxy[axis + 2] = (middle + root) / below
    if with_jacobian:
        for side in range(4):
            _side_jacobian(T, A, M, t, log_half_axes, side, xyxy[side], J[side])
    return True


@njit(cache=True)
def _side_jacobian(T, A, M, t, log_half_axes, side, value, row):
    """Fill row (12,): the contact point's motion along the side's normal n, over its depth."""
    axis, sign = side % 2, (-1.0 if side < 2 else 1.0)
    n, Mn, x = np.zeros(3), np.empty(3), np.empty(3)
    n[axis], n[2] = 1.0, -value
    for i in range(3):
        Mn[i] = M[i, axis] - value * M[i, 2]
    h = math.sqrt(max(Mn[axis] - value * Mn[2], 1e-300))  # 0 only if the size underflows
    for i in range(3):
        x[i] = t[i] + sign * Mn[i] / h
    contact_jacobian(T, n, x, row)
    for i in range(3):
        along = n[0] * A[0, i] + n[1] * A[1, i] + n[2] * A[2, i]
        row[9 + i] = sign * math.exp(2.0 * log_half_axes[i]) * along * along / (h * x[2])


@njit(cache=True)
def contact_jacobian(T, n, x, row):
    """Fill row[:9]: how a side with the normal n moves with the pose and the centre, touched in the point x (3,)."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        row[i] = (n[j] * x[k] - n[k] * x[j]) / x[2]  # n . (x × w) = w . (n × x)
        row[3 + i] = -n[i] / x[2]
        row[6 + i] = (T[i, 0] * n[0] + T[i, 1] * n[1] + T[i, 2] * n[2]) / x[2]


@njit(cache=True)
def _project_all(T, R_world_upright, centers, log_half_axes, xyxy, in_front):
    unused = np.zeros((4, 12))
    for i in range(len(centers)):
        in_front[i] = project_kernel(T, R_world_upright, centers[i], log_half_axes[i], xyxy[i], unused, False)
