"""A detected box against the projected volume.

Meger et al. (Mobile 3D Object Detection in Clutter, section III-D; Explicit Occlusion, equation (4), Psi_g) score a
hypothesis by a zero-mean Gaussian on the error of image centre and scale between the projected volume (`solid.py`) and
its detection. Centre and scale are linear in the four sides, so the same Gaussian is written on the sides b:

    r = b(X, L, S) - b_detected,      cost = rho_Huber(|r| / sigma_px)

Their variances, 0.25 for the centre and 0.5 for the scale, are relative to the detection's scale and belong to one
detector; here the caller gives the standard deviation of a side in pixels and divides it by sqrt(visibility).

A template for half an object answers with a box of that half, which is compared with the same half of the projected
box: b becomes A_part b, linear as well (here for the left half),

    A_left b = [b0, b1, (b0 + b2) / 2, b3],      J_left = A_left J.

A side cut off by the image border (or by an occluder) is censored: the true side lies at or beyond the reported one,
so the residual is zero there and the distance to it on the near side.
"""

from __future__ import annotations

import gtsam
import numpy as np
from numba import njit

from ..datasets.frame import Intrinsics
from .robust import huber
from .solid import solid_kernel
from .visibility import VolumePart

# By `VolumePart`: the side of a half's box that is the middle of the whole box; it lies opposite the side it replaces.
MIDDLE_SIDE = (-1, 3, 1, 2, 0)


def box_alignment_factor(
    x_key: int,
    l_key: int,
    s_key: int,
    xyxy: np.ndarray,
    sides_seen: np.ndarray,
    intrinsics: Intrinsics,
    R_world_upright: np.ndarray,
    sigma_px: float,
    part: int = VolumePart.WHOLE,
) -> gtsam.CustomFactor:
    """Ties a pose, an object's centre and its log half-axes by one detected box of the object or of one of its halves.

    Args:
        x_key, l_key, s_key: keys of a Pose3 T_world_camera, a Point3 (metres) and a Vector3 of log half-axes.
        xyxy: (4,) pixels, the detected box of the part.
        sides_seen: (4,) bool; False where the side is only a bound because the image border or an occluder cuts it.
        R_world_upright: (3, 3) axes of the volume in world coordinates.
        sigma_px: standard deviation of one side, pixels.
        part: `VolumePart`, what the box shows.

    The factor is switched off (zero residual and Jacobian) while the volume reaches the camera plane.

    Raises:
        ValueError: for a box that is not finite or not ordered, or a sigma that is not positive, or an unknown part.
    """
    measured, seen = np.array(xyxy, dtype=float), np.array(sides_seen, dtype=np.bool_)
    if measured.shape != (4,) or not (np.isfinite(measured).all() and (measured[:2] < measured[2:]).all()):
        raise ValueError(f"xyxy must be four finite pixels, left < right and top < bottom, but got {xyxy}")
    if seen.shape != (4,):
        raise ValueError(f"sides_seen must have shape (4,), but got {seen.shape}")
    if not 0.0 < sigma_px < np.inf:
        raise ValueError(f"sigma_px must be positive, but got {sigma_px}")
    middle = MIDDLE_SIDE[VolumePart(part)]
    # A detector may draw a clipped side some pixels inside or outside the border; what is certain is the laxer bound.
    inside = np.array([-0.5, -0.5, intrinsics.width - 0.5, intrinsics.height - 0.5])
    lax = np.concatenate([np.maximum(measured[:2], inside[:2]), np.minimum(measured[2:], inside[2:])])
    measured = np.where(seen, measured, lax)
    R = np.ascontiguousarray(R_world_upright, dtype=float)
    focal = np.array([intrinsics.fx, intrinsics.fy])
    principal = np.array([intrinsics.cx, intrinsics.cy])
    residual, J = np.empty(4), np.zeros((4, 12))  # gtsam copies them after every call
    J_pose, J_center, J_size = J[:, :6], J[:, 6:9], J[:, 9:]

    def error(this: gtsam.CustomFactor, values: gtsam.Values, H: list[np.ndarray] | None) -> np.ndarray:
        pose, center, size = values.atPose3(x_key).matrix(), values.atPoint3(l_key), values.atVector(s_key)
        _residual(pose, R, center, size, measured, seen, middle, focal, principal, residual, J, H is not None)
        if H is not None:
            H[0], H[1], H[2] = J_pose, J_center, J_size
        return residual

    return gtsam.CustomFactor(huber(gtsam.noiseModel.Isotropic.Sigma(4, sigma_px)), [x_key, l_key, s_key], error)


@njit(cache=True)
def _residual(pose, R, center, log_half_axes, measured, seen, middle, focal, principal, residual, J, with_jacobian):
    """Fill residual (4,) in pixels and J (4, 12)."""
    if not solid_kernel(pose, R, center, log_half_axes, residual, J, with_jacobian):
        residual[:] = 0.0
        return
    if middle >= 0:  # A_part
        opposite = (middle + 2) % 4
        residual[middle] = (residual[middle] + residual[opposite]) / 2.0
        if with_jacobian:
            J[middle] = (J[middle] + J[opposite]) / 2.0
    for side in range(4):
        axis = side % 2
        r = focal[axis] * residual[side] + principal[axis] - measured[side]
        scale = focal[axis]
        outwards = -r if side < 2 else r
        if not seen[side] and outwards >= 0.0:  # at or beyond its bound
            r, scale = 0.0, 0.0
        residual[side] = r
        if with_jacobian:
            J[side] *= scale
