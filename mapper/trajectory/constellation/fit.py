"""Corrections from matched things by weighted least squares, all hypotheses at once.

With p_j = R p_i + t + noise of covariance S_ij = Σ_j + R Σ_i R^T, the right tangent [w, v] moves R p + t by
R (w x p + v). The world's up is the same before and after but for `sigma_tilt`, so three things in a row suffice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

STEPS = 3  # of Gauss and Newton; from the upright solution the second is already below a millimetre


@dataclass(frozen=True, slots=True)
class Drift:
    """How far the recent part of the world may have drifted: standard deviations of its yaw (rad) and shift (m)."""

    sigma_yaw: float
    sigma_shift: float


@dataclass(frozen=True, slots=True, eq=False)
class Corrections:
    """S corrections in upright coordinates.

    Attributes:
        T: (S, 4, 4) old from recent.
        covariance: (S, 6, 6) in their right tangents [rad, m].
        misfit: (S, N) squared Mahalanobis distance of every matched recent thing to its partner, 0 for the others.
        log_prior: (S,) nats, density of the correction before; `log_volume`: (S,) of the space it has left afterwards.
    """

    T: np.ndarray
    covariance: np.ndarray
    misfit: np.ndarray
    log_prior: np.ndarray
    log_volume: np.ndarray


def fit_corrections(
    recent: np.ndarray,
    old: np.ndarray,
    noise_recent: np.ndarray,
    noise_old: np.ndarray,
    partners: np.ndarray,
    sigma_tilt: float,
    space: float,
    drift: Drift | None,
) -> Corrections:
    """One correction for every row of partners.

    Args:
        recent, old: (N, 3), (M, 3) metres, z up.
        noise_recent, noise_old: (N, 3, 3), (M, 3, 3) square metres.
        partners: (S, N) old thing of each recent one, or -1.
        sigma_tilt: rad, of the correction's deviation from upright.
        space: cubic metres that the things may lie in, where nothing is known of the drift.
        drift: what is known of it.
    """
    matched, target = partners >= 0, old[partners]
    T = _upright(recent, target, matched.astype(float))

    def equations() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return _normal_equations(T, recent, target, noise_recent, noise_old[partners], matched, sigma_tilt)

    for _ in range(STEPS):
        information, gradient, _ = equations()
        step = np.linalg.solve(information, gradient[..., None])[..., 0]
        T[:, :3, 3] += np.einsum("sij,sj->si", T[:, :3, :3], step[:, 3:])
        T[:, :3, :3] = T[:, :3, :3] @ Rotation.from_rotvec(step[:, :3]).as_matrix()
    information, _, misfit = equations()
    covariance = np.linalg.inv(information)
    log_volume = 0.5 * np.linalg.slogdet(2.0 * np.pi * covariance)[1]
    return Corrections(T, covariance, misfit, _log_prior(T, recent, sigma_tilt, space, drift), log_volume)


def _upright(recent: np.ndarray, target: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(S, 4, 4) least squares in yaw and translation, weights (S, N)."""
    w = (weight / weight.sum(axis=1, keepdims=True))[..., None]
    mean_recent, mean_target = (w * recent).sum(axis=1), (w * target).sum(axis=1)
    a, b = recent - mean_recent[:, None], target - mean_target[:, None]
    across = (w[..., 0] * (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])).sum(axis=1)
    along = (w[..., 0] * (a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1])).sum(axis=1)
    T = np.tile(np.eye(4), (len(weight), 1, 1))
    T[:, :3, :3] = Rotation.from_rotvec(np.arctan2(across, along)[:, None] * [0.0, 0.0, 1.0]).as_matrix()
    T[:, :3, 3] = mean_target - np.einsum("sij,sj->si", T[:, :3, :3], mean_recent)
    return T


def _normal_equations(
    T: np.ndarray,
    recent: np.ndarray,
    target: np.ndarray,
    noise_recent: np.ndarray,
    noise_target: np.ndarray,
    matched: np.ndarray,
    sigma_tilt: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(S, 6, 6) information and (S, 6) gradient of the residuals target - T recent, and their (S, N) misfits."""
    R = T[:, None, :3, :3]
    residual = target - recent @ np.swapaxes(T[:, :3, :3], 1, 2) - T[:, None, :3, 3]
    weight = np.linalg.inv(noise_target + R @ noise_recent @ np.swapaxes(R, -1, -2)) * matched[..., None, None]
    x, y, z = recent.T
    zero = np.zeros(len(recent))
    cross = np.stack([np.stack([zero, z, -y], 1), np.stack([-z, zero, x], 1), np.stack([y, -x, zero], 1)], 1)
    tangent = np.concatenate([cross, np.tile(np.eye(3), (len(recent), 1, 1))], axis=2)
    J = R @ tangent
    weighted = weight @ J
    information = np.einsum("snki,snkj->sij", J, weighted)
    gradient = np.einsum("snki,snk->si", weighted, residual)
    misfit = np.einsum("snk,snkl,snl->sn", residual, weight, residual)
    # up stays up: with u = R^T z, turning by w moves its horizontal part by (-w_y, w_x) where the tilt is small
    u = T[:, 2, :2]
    information[:, [0, 1], [0, 1]] += 1.0 / sigma_tilt**2
    gradient[:, 0] -= u[:, 1] / sigma_tilt**2
    gradient[:, 1] += u[:, 0] / sigma_tilt**2
    return information, gradient, misfit


def log_density(space: float, drift: Drift | None) -> float:
    """Greatest density of yaw and shift: where nothing is known any yaw, and anywhere in `space` cubic metres."""
    if drift is None:
        return -float(np.log(2.0 * np.pi * space))
    return -float(2.0 * np.log(2.0 * np.pi) + np.log(drift.sigma_yaw) + 3.0 * np.log(drift.sigma_shift))


def _log_prior(T: np.ndarray, recent: np.ndarray, sigma_tilt: float, space: float, drift: Drift | None) -> np.ndarray:
    """(S,) nats: density of yaw, tilt and shift of the recent things' middle."""
    tilt = np.square(T[:, 2, :2]).sum(axis=1) / sigma_tilt**2
    misfit = np.zeros(len(T))
    if drift is not None:
        yaw = np.arctan2(T[:, 1, 0] - T[:, 0, 1], T[:, 0, 0] + T[:, 1, 1])
        middle = recent.mean(axis=0)
        shift = T[:, :3, :3] @ middle + T[:, :3, 3] - middle
        misfit = (yaw / drift.sigma_yaw) ** 2 + np.square(shift / drift.sigma_shift).sum(axis=1)
    return log_density(space, drift) - np.log(2.0 * np.pi * sigma_tilt**2) - 0.5 * (tilt + misfit)
