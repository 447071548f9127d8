"""The solid that fills a volume's extents, seen by a camera: its image box, and how the box moves.

Objects fill their extents better than the inscribed ellipsoid does: a can or a box seen from above reaches as far as
its edges. Fitted to their image boxes, ellipsoids came out 3 to 25 % too high and up to 50 % too broad (rendered
table-tops; a cabinet of 56 cm as 81 cm). So detected boxes are compared with an upright elliptic cylinder with rounded
edges: the sum, point by point, of a flat ellipsoid D and a tall one N,

    half-axes of D: (a_0, a_1, r a_2) / (1 + r),      of N: (r a_0, r a_1, a_2) / (1 + r),

whose extents are a, whatever the roundness r: 0 is the cylinder with sharp edges, 1 the ellipsoid of `volume.py`. How
far it reaches from its centre along a vector n is h(n) = sqrt(n^T D n) + sqrt(n^T N n), with the spreads D and N (as M
in `volume.py`) in the camera frame, and the plane with normal n = (1, 0, -u) through the camera touches it where

    g(u) = n · t +- h(n) = 0      in the point      x = t +- (D n / sqrt(n^T D n) + N n / sqrt(n^T N n)).

g is convex in u and its slope is -x_z, so Newton's step leads to the projection x_x / x_z of the point of contact, and
from the centre's projection it never oversteps. The Jacobian follows from that point as in `volume.py`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ..datasets.frame import Intrinsics
from .volume import NEAR_MARGIN_M, Projection, camera_axes, contact_jacobian, in_pixels, projection

# Between cans, boxes and bowls: 0.15 and ellipsoids were compared on six rendered surveys (sizes off by 6 % instead of
# 8, the map's mean average precision in images .91 instead of .88) and on the cabinet.
ROUNDNESS = 0.15
_STEPS = 20  # at most; five reach the last bit unless the solid nearly touches the camera
_DONE = 1e-14  # of the image coordinate
_FLAT = ROUNDNESS**2  # of a squared half-axis, across an ellipsoid's own directions
_SCALE = 1.0 / (1.0 + ROUNDNESS) ** 2


def project_solid(
    T_world_camera: np.ndarray, R_world_upright: np.ndarray, center: np.ndarray, log_half_axes: np.ndarray
) -> Projection:
    """Image box of a volume's solid with its Jacobians (the module's equations).

    Args:
        T_world_camera: (4, 4).
        R_world_upright: (3, 3), columns are the volume's axes in world coordinates, the last one up.
        center: (3,) metres, world frame.
        log_half_axes: (3,) log of metres, along the columns of `R_world_upright`.
    """
    return projection(solid_kernel, T_world_camera, R_world_upright, center, log_half_axes)


def project_solids(
    T_world_camera: np.ndarray,
    R_world_upright: np.ndarray,
    centers: np.ndarray,
    log_half_axes: np.ndarray,
    intrinsics: Intrinsics,
) -> tuple[np.ndarray, np.ndarray]:
    """Image boxes of the solids of N volumes: arguments and results as of `volume.project_volumes`."""
    return in_pixels(_project_all, T_world_camera, R_world_upright, centers, log_half_axes, intrinsics)


@njit(cache=True)
def solid_kernel(T, R_world_upright, center, log_half_axes, xyxy, J, with_jacobian):
    """Fill xyxy (4,) and, if asked, J (4, 12) = [pose, centre, size]; False (NaN, zeros) where not in front."""
    A, D, N, t = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    _in_camera(T, R_world_upright, center, log_half_axes, A, D, N, t)
    if not t[2] - math.sqrt(D[2, 2]) - math.sqrt(N[2, 2]) > NEAR_MARGIN_M:  # "not >" also catches NaN
        xyxy[:] = np.nan
        J[:] = 0.0
        return False
    n, x, h = np.zeros(3), np.empty(3), np.empty(2)
    for side in range(4):
        axis = side % 2
        n[axis], n[1 - axis] = 1.0, 0.0
        value = t[axis] / t[2]
        for _ in range(_STEPS):
            _contact(D, N, t, axis, -1.0 if side < 2 else 1.0, value, n, x, h)
            step = x[axis] / x[2] - value
            value += step
            if abs(step) < _DONE:
                break
        xyxy[side] = value
        if with_jacobian:
            _side_jacobian(T, A, log_half_axes, n, x, h, -1.0 if side < 2 else 1.0, J[side])
    return True


@njit(cache=True)
def _in_camera(T, R, center, log_half_axes, A, D, N, t):
    """Fill axes A (3, 3), spreads D and N (3, 3) and centre t (3,) in the camera frame."""
    camera_axes(T, R, center, A, t)
    squares = np.exp(2.0 * log_half_axes)
    for i in range(3):
        for j in range(i + 1):
            level = squares[0] * A[i, 0] * A[j, 0] + squares[1] * A[i, 1] * A[j, 1]
            upright = squares[2] * A[i, 2] * A[j, 2]
            D[i, j] = D[j, i] = _SCALE * (level + _FLAT * upright)
            N[i, j] = N[j, i] = _SCALE * (_FLAT * level + upright)


@njit(cache=True)
def _contact(D, N, t, axis, sign, value, n, x, h):
    """Fill n[2], the point x (3,) farthest along sign * n, and how far D and N reach, h (2,)."""
    n[2] = -value
    for i in range(3):
        x[i] = t[i]
    for which in range(2):
        M = D if which == 0 else N
        # 0 only if the size underflows
        h[which] = math.sqrt(max(M[axis, axis] - 2.0 * value * M[axis, 2] + value * value * M[2, 2], 1e-300))
        for i in range(3):
            x[i] += sign * (M[i, axis] - value * M[i, 2]) / h[which]


@njit(cache=True)
def _side_jacobian(T, A, log_half_axes, n, x, h, sign, row):
    """Fill row (12,): the contact point's motion along the side's normal n, over its depth."""
    contact_jacobian(T, n, x, row)
    for i in range(3):
        along = n[0] * A[0, i] + n[1] * A[1, i] + n[2] * A[2, i]
        reach = _FLAT / h[0] + 1.0 / h[1] if i == 2 else 1.0 / h[0] + _FLAT / h[1]
        row[9 + i] = sign * _SCALE * math.exp(2.0 * log_half_axes[i]) * along * along * reach / x[2]


@njit(cache=True)
def _project_all(T, R_world_upright, centers, log_half_axes, xyxy, in_front):
    unused = np.zeros((4, 12))
    for i in range(len(centers)):
        in_front[i] = solid_kernel(T, R_world_upright, centers[i], log_half_axes[i], xyxy[i], unused, False)
