"""The rigid motion between two frames from their features, with its covariance.

Features are matched, and the motion between the two point sets is found by RANSAC and least squares (Umeyama 1991).
Aligning points to points keeps the depth of both sides honest: with PnP, which takes one side's depth as exact, the
path of a hand-held Kinect was bent by 5 degrees against the orientations, with 3D-3D by 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...config import VisualConfig
from ..rigid import pose_covariance, rigid_motion
from .features import Features

SAMPLES = 300  # RANSAC hypotheses of three pairs: 99.9 % sure to hit at 30 % inliers


@dataclass(frozen=True, slots=True, eq=False)
class RelativePose:
    """A measured motion: (4, 4) `T_a_b`, (6, 6) covariance in its right tangent [rad, m], matches that agree."""

    T_a_b: np.ndarray
    covariance: np.ndarray
    inliers: int


@dataclass(frozen=True, slots=True, eq=False)
class RobustMotion:
    """The motion that most pairs of points agree on: (4, 4) `T`, and (M,) bool which pairs do."""

    T: np.ndarray
    inliers: np.ndarray


def relative_pose(a: Features, b: Features, config: VisualConfig, seed: int = 0) -> RelativePose | None:
    """Pose of frame b in frame a; None where fewer than `config.min_inliers` matches agree on one."""
    source, target = _match(a, b, config.ratio)
    fit = robust_motion(source, target, config.inlier_distance, config.min_inliers, seed)
    if fit is None:
        return None
    covariance = _covariance(fit.T, source[fit.inliers], target[fit.inliers], config.covariance_floor)
    return RelativePose(fit.T, covariance, int(fit.inliers.sum()))


def robust_motion(
    source: np.ndarray, target: np.ndarray, distance: float, min_inliers: int, seed: int = 0
) -> RobustMotion | None:
    """The motion that takes most of `source` to `target`: RANSAC, then weighted least squares.

    Args:
        source, target: (M, 3) metres, camera frames.
        distance: metres at 1 m and nearer, growing with z, up to which a pair agrees.
        min_inliers: pairs that must agree, else the answer is None.
        seed: of the samples.
    """
    if len(source) < min_inliers:
        return None
    inliers = _ransac(source, target, distance, seed)
    T = np.eye(4)
    for _ in range(3):
        if inliers.sum() < min_inliers:
            return None
        T = rigid_motion(source[inliers], target[inliers], _weights(target[inliers]))
        inliers = _agree(T, source, target, distance)
    return RobustMotion(T, inliers) if inliers.sum() >= min_inliers else None


def _match(a: Features, b: Features, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """(M, 3) points of b and of a whose descriptors pass the ratio test."""
    if len(a) < 2 or len(b) < 2:
        return np.empty((0, 3)), np.empty((0, 3))
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(b.descriptors, a.descriptors, k=2)
    kept = [(m.queryIdx, m.trainIdx) for m, n in pairs if m.distance < ratio * n.distance]
    query, train = np.array(kept, dtype=int).reshape(-1, 2).T
    return b.points[query], a.points[train]


def _ransac(source: np.ndarray, target: np.ndarray, distance: float, seed: int) -> np.ndarray:
    """(M,) bool, the pairs that agree with the best of many motions from three pairs each."""
    triples = np.random.default_rng(seed).integers(0, len(source), (SAMPLES, 3))
    motions = rigid_motion(source[triples], target[triples], np.ones((SAMPLES, 3)))
    apart = motions[:, :3, :3] @ source.T + motions[:, :3, 3:] - target.T  # (SAMPLES, 3, M)
    agree = (apart**2).sum(axis=1) < _tolerance(target, distance) ** 2
    return agree[int(np.argmax(agree.sum(axis=1)))]


def _agree(T: np.ndarray, source: np.ndarray, target: np.ndarray, distance: float) -> np.ndarray:
    residual = np.linalg.norm(source @ T[:3, :3].T + T[:3, 3] - target, axis=1)
    return residual < _tolerance(target, distance)


def _tolerance(target: np.ndarray, distance: float) -> np.ndarray:
    """(M,) metres: depth noise grows with distance."""
    return distance * np.maximum(target[:, 2], 1.0)


def _covariance(T_a_b: np.ndarray, source: np.ndarray, target: np.ndarray, floor: tuple[float, float]) -> np.ndarray:
    """(6, 6) in the right tangent of `T_a_b`: moving it by [w, v] moves R p + t by R (w x p + v)."""
    x, y, z = source.T
    zero = np.zeros(len(source))
    cross = np.stack([np.stack([zero, z, -y], 1), np.stack([-z, zero, x], 1), np.stack([y, -x, zero], 1)], 1)
    J = np.concatenate([cross, np.broadcast_to(np.eye(3), (len(source), 3, 3))], axis=2)
    weights = _weights(target)
    residual = source @ T_a_b[:3, :3].T + T_a_b[:3, 3] - target
    variance = float(weights @ (residual**2).sum(axis=1)) / max(3 * len(source) - 6, 1)
    information = np.einsum("n,nki,nkj->ij", weights, J, J) / max(variance, 1e-12)
    return np.linalg.inv(information + 1e-6 * np.eye(6)) + pose_covariance(floor)


def _weights(target: np.ndarray) -> np.ndarray:
    """(N,) inverse variances up to a factor: noise grows with distance."""
    return 1.0 / np.maximum(target[:, 2], 0.3) ** 2
