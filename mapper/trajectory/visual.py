"""Relative poses between neighbouring keyframes from image features and depth.

KISS-ICP slips along bare planes and counters; corners in the image hold those directions. ORB features of the new
keyframe are matched to those of the last few, both sides with depth, and the rigid motion between the two point sets
is found by RANSAC and least squares (Umeyama 1991). Aligning points to points keeps the depth of both sides honest:
with PnP, which takes one side's depth as exact, the path of a hand-held Kinect was bent by 5 degrees against the
orientations, with 3D-3D by 1.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np

from ...datasets.frame import Frame
from ..config import VisualConfig

SAMPLES = 300  # RANSAC hypotheses of three pairs: 99.9 % sure to hit at 30 % inliers


@dataclass(frozen=True, slots=True, eq=False)
class VisualEdge:
    """Measured motion between keyframes `a` and `b`: (4, 4) `T_a_b`, (6, 6) covariance [rad, m], inliers."""

    a: int
    b: int
    T_a_b: np.ndarray
    covariance: np.ndarray
    inliers: int


@dataclass(frozen=True, slots=True, eq=False)
class _Features:
    keyframe: int
    descriptors: np.ndarray  # (N, 32) uint8
    points: np.ndarray  # (N, 3) camera frame, metres


class VisualOdometry:
    """Remembers the features of the last keyframes; measures each new one against them."""

    def __init__(self, config: VisualConfig, seed: int) -> None:
        self._config, self._seed = config, seed
        self._orb = cv2.ORB.create(config.features, fastThreshold=config.fast_threshold)
        self._matcher = cv2.BFMatcher(cv2.NORM_HAMMING)
        self._recent: deque[_Features] = deque(maxlen=config.neighbours)

    def add_keyframe(self, frame: Frame, keyframe: int) -> list[VisualEdge]:
        """Edges from the last keyframes to this one; fewer, or none, where too little matches."""
        features = self._extract(frame, keyframe)
        edges = [self._relative(old, features) for old in self._recent]
        self._recent.append(features)
        return [edge for edge in edges if edge is not None]

    def _extract(self, frame: Frame, keyframe: int) -> _Features:
        """ORB features that have depth."""
        grey = cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY)
        found, descriptors = self._orb.detectAndCompute(grey, None)
        if descriptors is None:
            return _Features(keyframe, np.empty((0, 32), dtype=np.uint8), np.empty((0, 3)))
        uv = np.array([p.pt for p in found])
        column, row = np.rint(uv).astype(int).T
        z = frame.depth[row, column].astype(np.float64)
        low, high = self._config.depth_range
        usable = (z > low) & (z < high)
        return _Features(keyframe, descriptors[usable], frame.intrinsics.back_project(uv[usable], z[usable]))

    def _relative(self, old: _Features, new: _Features) -> VisualEdge | None:
        source, target = self._match(old, new)
        if len(source) < self._config.min_inliers:
            return None
        inliers = self._ransac(source, target)
        T_a_b = np.eye(4)
        for _ in range(3):
            if inliers.sum() < self._config.min_inliers:
                return None
            T_a_b = rigid_motion(source[inliers], target[inliers], _weights(target[inliers]))
            inliers = self._agree(T_a_b, source, target)
        if inliers.sum() < self._config.min_inliers:
            return None
        covariance = self._covariance(T_a_b, source[inliers], target[inliers])
        return VisualEdge(old.keyframe, new.keyframe, T_a_b, covariance, int(inliers.sum()))

    def _match(self, old: _Features, new: _Features) -> tuple[np.ndarray, np.ndarray]:
        """(M, 3) points of the new and of the old keyframe whose descriptors pass the ratio test."""
        if len(old.points) < 2 or len(new.points) < 2:
            return np.empty((0, 3)), np.empty((0, 3))
        pairs = self._matcher.knnMatch(new.descriptors, old.descriptors, k=2)
        kept = [(m.queryIdx, m.trainIdx) for m, n in pairs if m.distance < self._config.ratio * n.distance]
        query, train = np.array(kept, dtype=int).reshape(-1, 2).T
        return new.points[query], old.points[train]

    def _ransac(self, source: np.ndarray, target: np.ndarray) -> np.ndarray:
        """(M,) bool, the pairs that agree with the best of many motions from three pairs each."""
        rng = np.random.default_rng(self._seed)
        triples = rng.integers(0, len(source), (SAMPLES, 3))
        motions = rigid_motion(source[triples], target[triples], np.ones((SAMPLES, 3)))
        apart = motions[:, :3, :3] @ source.T + motions[:, :3, 3:] - target.T  # (SAMPLES, 3, M)
        agree = (apart**2).sum(axis=1) < self._tolerance(target) ** 2
        return agree[int(np.argmax(agree.sum(axis=1)))]

    def _agree(self, T: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
        residual = np.linalg.norm(source @ T[:3, :3].T + T[:3, 3] - target, axis=1)
        return residual < self._tolerance(target)

    def _tolerance(self, target: np.ndarray) -> np.ndarray:
        """(M,) metres: depth noise grows with distance."""
        return self._config.inlier_distance * np.maximum(target[:, 2], 1.0)

    def _covariance(self, T_a_b: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
        """(6, 6) in the right tangent of `T_a_b`: moving it by [w, v] moves R p + t by R (w x p + v)."""
        x, y, z = source.T
        zero = np.zeros(len(source))
        cross = np.stack([np.stack([zero, z, -y], 1), np.stack([-z, zero, x], 1), np.stack([y, -x, zero], 1)], 1)
        J = np.concatenate([cross, np.broadcast_to(np.eye(3), (len(source), 3, 3))], axis=2)
        weights = _weights(target)
        residual = source @ T_a_b[:3, :3].T + T_a_b[:3, 3] - target
        variance = float(weights @ (residual**2).sum(axis=1)) / max(3 * len(source) - 6, 1)
        information = np.einsum("n,nki,nkj->ij", weights, J, J) / max(variance, 1e-12)
        floor_r, floor_t = self._config.covariance_floor
        return np.linalg.inv(information + 1e-6 * np.eye(6)) + np.diag(np.repeat([floor_r**2, floor_t**2], 3))


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


def _weights(target: np.ndarray) -> np.ndarray:
    """(N,) inverse variances up to a factor: noise grows with distance."""
    return 1.0 / np.maximum(target[:, 2], 0.3) ** 2
