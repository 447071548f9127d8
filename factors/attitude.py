"""The world's up direction as one variable U of the graph, seen by every pose whose camera knows where up is.

    r = B^T (R_world_camera^T u),      B (3, 2): an orthonormal basis of the plane normal to up_camera

The predicted up direction, in the camera frame, is compared with the measured one in the plane tangent to the
measurement: |r| is the sine of the angle between them. With q = R_world_camera^T u, a right tangent w of the pose's
rotation moves it by dq = q × w, and a tangent xi of U (gtsam's Unit3) by dq = R_world_camera^T basis(u) xi.

The sine is ambiguous beyond 90 degrees: start U from the first measurement.
"""

from __future__ import annotations

import gtsam
import numpy as np

from .robust import huber


def attitude_factor(x_key: int, u_key: int, up_camera: np.ndarray, sigma_rad: float) -> gtsam.CustomFactor:
    """Ties a pose and the world's up direction by up as the camera measured it (accelerometer at rest, a floor).

    Args:
        x_key, u_key: keys of a Pose3 T_world_camera and a Unit3 (`values.insert(u_key, gtsam.Unit3(up_world))`).
        up_camera: (3,) up in the camera frame; any length.
        sigma_rad: standard deviation of the direction, radians; Huber's loss.

    Raises:
        ValueError: for a zero or not finite direction, or a sigma that is not positive.
    """
    B = _unit(up_camera, sigma_rad).basis()
    J_pose, skew = np.zeros((2, 6)), np.zeros((3, 3))  # gtsam copies them after every call

    def error(this: gtsam.CustomFactor, values: gtsam.Values, H: list[np.ndarray] | None) -> np.ndarray:
        R = values.atPose3(x_key).rotation().matrix()
        up = values.atUnit3(u_key)
        x, y, z = q = R.T @ up.point3()
        if H is not None:
            skew[:] = (0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)
            J_pose[:, :3] = B.T @ skew
            H[0], H[1] = J_pose, B.T @ R.T @ up.basis()
        return B.T @ q

    return gtsam.CustomFactor(huber(gtsam.noiseModel.Isotropic.Sigma(2, sigma_rad)), [x_key, u_key], error)


def up_prior(u_key: int, up_world: np.ndarray, sigma_rad: float) -> gtsam.PriorFactorUnit3:
    """Holds the world's up direction near a known one, (3,) of any length in world coordinates.

    Raises:
        ValueError: as `attitude_factor`.
    """
    return gtsam.PriorFactorUnit3(u_key, _unit(up_world, sigma_rad), gtsam.noiseModel.Isotropic.Sigma(2, sigma_rad))


def _unit(direction: np.ndarray, sigma_rad: float) -> gtsam.Unit3:
    direction = np.asarray(direction, dtype=float)
    if direction.shape != (3,) or not 1e-9 < float(np.linalg.norm(direction)) < np.inf:
        raise ValueError(f"an up direction must be a finite vector (3,) other than zero, but got {direction.tolist()}")
    if not 0.0 < sigma_rad < np.inf:
        raise ValueError(f"sigma_rad must be positive, but got {sigma_rad}")
    return gtsam.Unit3(direction)
