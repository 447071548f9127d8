"""Rigid transforms as (4, 4) matrices, and the one that takes one point set to another."""

from __future__ import annotations

import gtsam
import numpy as np


def inverse(T: np.ndarray) -> np.ndarray:
    """Inverse of a (4, 4) rigid transform."""
    R, t = T[:3, :3], T[:3, 3]
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = R.T, -R.T @ t
    return result


def tangent(T: np.ndarray, T_other: np.ndarray) -> np.ndarray:
    """(6,) [rot, trans] rad, m, from one (4, 4) pose to another in the first one's right tangent: Log(T^-1 T_other)."""
    return gtsam.Pose3.Logmap(gtsam.Pose3(nearest_rigid(T)).between(gtsam.Pose3(nearest_rigid(T_other))))


def chi_square(T: np.ndarray, T_other: np.ndarray, covariance: np.ndarray) -> float:
    """Squared Mahalanobis distance of two (4, 4) poses, by a (6, 6) covariance in the first one's right tangent."""
    off = tangent(T, T_other)
    return float(off @ np.linalg.solve(covariance, off))


def retracted(T: np.ndarray, step: np.ndarray) -> np.ndarray:
    """(4, 4) pose a (6,) step in its right tangent away: T Exp(step)."""
    return nearest_rigid(T @ gtsam.Pose3.Expmap(step).matrix())


def pose_covariance(sigma: tuple[float, float]) -> np.ndarray:
    """(6, 6) of a pose known to (rad, m) in every direction."""
    return np.diag(np.repeat(np.square(sigma), 3))


def rotation_angle(R: np.ndarray) -> float:
    """Angle of a (3, 3) rotation, rad."""
    return float(np.arccos(np.clip((np.trace(R) - 1.0) / 2.0, -1.0, 1.0)))


def nearest_rigid(T: np.ndarray) -> np.ndarray:
    """(4, 4) with its rotation made orthonormal: errors of rounding grow where each pose starts the next."""
    U, _, Vt = np.linalg.svd(T[:3, :3])
    result = T.copy()
    result[:3, :3] = U @ Vt
    return result


def rigid_motion(source: np.ndarray, target: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted least-squares motion that takes `source` to `target` (Umeyama 1991, without scale).

    Args:
        source, target: (..., N, 3) metres; leading axes are independent problems.
        weights: (..., N).

    Returns:
        (..., 4, 4) with target ≈ R source + t.
    """
    w = (weights / weights.sum(axis=-1, keepdims=True))[..., None]
    mean_source, mean_target = (w * source).sum(axis=-2), (w * target).sum(axis=-2)
    H = np.swapaxes(w * (target - mean_target[..., None, :]), -1, -2) @ (source - mean_source[..., None, :])
    U, _, Vt = np.linalg.svd(H)
    sign = np.ones((*H.shape[:-2], 3))
    sign[..., 2] = np.sign(np.linalg.det(U @ Vt))
    T = np.zeros((*H.shape[:-2], 4, 4))
    T[..., :3, :3] = (U * sign[..., None, :]) @ Vt
    T[..., :3, 3] = mean_target - np.einsum("...ij,...j->...i", T[..., :3, :3], mean_source)
    T[..., 3, 3] = 1.0
    return T
