"""What ties poses to each other and to the world: odometry and loop closures, and the gauge.

    r = Log(T_a_b_measured^-1 · X_a^-1 · X_b),      cost = r^T Sigma^-1 r   (Huber's loss for loop closures)

Matrices are checked before gtsam sees them: it neither checks nor survives a bad one.
"""

from __future__ import annotations

import gtsam
import numpy as np

from .robust import huber

ROTATION_TOLERANCE = 1e-3  # poses read from text have 4 to 7 digits


def pose3(T: np.ndarray) -> gtsam.Pose3:
    """(4, 4) rigid transform to a gtsam Pose3; its rotation is replaced by the nearest exact one.

    Raises:
        ValueError: where T is not finite, not of shape (4, 4), its last row is not [0, 0, 0, 1], or its rotation is
            off by more than `ROTATION_TOLERANCE` or left-handed.
    """
    T = np.asarray(T, dtype=float)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise ValueError(f"a pose must be a finite (4, 4) matrix, but got shape {T.shape}: {T.tolist()}")
    if np.abs(T[3] - [0.0, 0.0, 0.0, 1.0]).max() > 1e-9:
        raise ValueError(f"the last row of a pose must be [0, 0, 0, 1], but got {T[3].tolist()}")
    U, scales, Vt = np.linalg.svd(T[:3, :3])
    R = U @ Vt
    if np.abs(scales - 1.0).max() > ROTATION_TOLERANCE or np.linalg.det(R) < 0.0:
        raise ValueError(f"the rotation of a pose must be orthonormal and right-handed, but got {T[:3, :3].tolist()}")
    return gtsam.Pose3(gtsam.Rot3(R), T[:3, 3])


def between_factor(
    x_key_a: int, x_key_b: int, T_a_b: np.ndarray, covariance: np.ndarray, robust: bool = False
) -> gtsam.BetweenFactorPose3:
    """Ties two poses by a measured motion.

    Args:
        x_key_a, x_key_b: keys of two Pose3.
        T_a_b: (4, 4) measured pose of b in a's frame.
        covariance: (6, 6) of [rot, trans] in the right tangent of T_a_b, radians and metres.
        robust: use Huber's loss (loop closures, visual edges).

    Raises:
        ValueError: see `pose3`; also where the covariance is not symmetric and positive definite.
    """
    noise = gtsam.noiseModel.Gaussian.Covariance(_checked_covariance(covariance))
    return gtsam.BetweenFactorPose3(x_key_a, x_key_b, pose3(T_a_b), huber(noise) if robust else noise)


def gauge_prior(x_key: int, T_world_camera: np.ndarray, sigmas: np.ndarray) -> gtsam.PriorFactorPose3:
    """Fixes a pose in the world: standard deviations (6,) of [rot, trans], radians and metres.

    Raises:
        ValueError: see `pose3`; also for sigmas that are not positive.
    """
    sigmas = np.asarray(sigmas, dtype=float)
    if sigmas.shape != (6,) or not ((sigmas > 0.0) & (sigmas < np.inf)).all():
        raise ValueError(f"sigmas must be six positive numbers, but got {sigmas.tolist()}")
    return gtsam.PriorFactorPose3(x_key, pose3(T_world_camera), gtsam.noiseModel.Diagonal.Sigmas(sigmas))


def _checked_covariance(covariance: np.ndarray) -> np.ndarray:
    covariance = np.asarray(covariance, dtype=float)
    if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
        raise ValueError(f"a pose covariance must be a finite (6, 6) matrix, but got shape {covariance.shape}")
    symmetric = (covariance + covariance.T) / 2.0
    if np.abs(covariance - symmetric).max() > 1e-6 * np.abs(covariance).max():
        raise ValueError("a pose covariance must be symmetric")
    try:
        np.linalg.cholesky(symmetric)
    except np.linalg.LinAlgError:
        lowest = np.linalg.eigvalsh(symmetric)[0]
        raise ValueError(
            f"a pose covariance must be positive definite, but its lowest eigenvalue is {lowest}"
        ) from None
    return symmetric
