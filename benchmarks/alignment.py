"""Rigid alignment of an estimated trajectory to the true one, and the error that is left.

    positions   Umeyama 1991 with unit scale: min over R, t of sum |R p_i + t - q_i|^2
    poses       rotation averaging: R is the chordal mean of R_true_i R_estimated_i^T, then t is the mean of q_i - R p_i

A short path that hardly bends leaves the rotation of the first weak; the second takes it from the cameras' directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thingmap.datasets.errors import UserError

MIN_SPREAD = 1e-6  # of the second singular value to the first: positions on a line leave a rotation about it free


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """p -> R p + t: (3, 3) rotation and (3,) metres from the estimate's axes to the true ones."""

    R: np.ndarray
    t: np.ndarray

    def apply(self, points: np.ndarray) -> np.ndarray:
        """(3,) or (N, 3) points of the estimate in true axes."""
        return points @ self.R.T + self.t

    def angle_to(self, other: Alignment) -> float:
        """Angle between two alignments' rotations, rad."""
        cosine = (np.trace(self.R.T @ other.R) - 1.0) / 2.0
        return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def align_positions(estimate: np.ndarray, truth: np.ndarray) -> Alignment:
    """Least squares over camera positions.

    Args:
        estimate, truth: (N, 4, 4) `T_world_camera` of the same frames.

    Raises:
        UserError: fewer than three poses, or positions on one line.
    """
    _check(estimate, truth)
    p, q = estimate[:, :3, 3], truth[:, :3, 3]
    U, scales, Vt = np.linalg.svd((q - q.mean(axis=0)).T @ (p - p.mean(axis=0)))
    if not scales[1] > MIN_SPREAD * scales[0]:
        raise UserError("the camera's positions lie on one line: they do not tell the rotation; align by poses")
    R = _proper(U, Vt)
    return Alignment(R, q.mean(axis=0) - R @ p.mean(axis=0))


def align_poses(estimate: np.ndarray, truth: np.ndarray) -> Alignment:
    """Rotation averaging over camera orientations, then the mean shift; arguments as `align_positions`."""
    _check(estimate, truth)
    U, _, Vt = np.linalg.svd(np.einsum("nij,nkj->ik", truth[:, :3, :3], estimate[:, :3, :3]))
    R = _proper(U, Vt)
    return Alignment(R, (truth[:, :3, 3] - estimate[:, :3, 3] @ R.T).mean(axis=0))


def trajectory_error(estimate: np.ndarray, truth: np.ndarray, alignment: Alignment) -> float:
    """Absolute trajectory error (root mean square of the positions' differences), metres."""
    difference = alignment.apply(estimate[:, :3, 3]) - truth[:, :3, 3]
    return float(np.sqrt((difference**2).sum(axis=1).mean()))


def _proper(U: np.ndarray, Vt: np.ndarray) -> np.ndarray:
    """The rotation nearest to U S Vt, never a reflection."""
    return U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt


def _check(estimate: np.ndarray, truth: np.ndarray) -> None:
    if estimate.shape != truth.shape or estimate.shape[1:] != (4, 4) or len(estimate) < 3:
        raise UserError(f"need (N, 4, 4) poses of the same N >= 3 frames, got {estimate.shape} and {truth.shape}")
    if not (np.isfinite(estimate).all() and np.isfinite(truth).all()):
        raise UserError("poses must be finite")
