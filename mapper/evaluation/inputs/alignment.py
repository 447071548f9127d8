"""Alignment of an estimated trajectory to the true one, and the error that is left.

    positions   Umeyama 1991 with unit scale: min over R, t of sum |R p_i + t - q_i|^2
    similarity  Umeyama 1991: min over s, R, t of sum |s R p_i + t - q_i|^2
    poses       rotation averaging: R is the chordal mean of R_true_i R_estimated_i^T, then t is the mean of q_i - R p_i
    anchor      the first pose is made the same

A short path that hardly bends leaves the rotation of the first two weak; the third takes it from the cameras'
directions. Objects are therefore compared by poses.
"""

from __future__ import annotations

import numpy as np

from ....datasets.errors import UserError
from .case import Alignment

MIN_SPREAD = 1e-6  # of the second singular value to the first: positions on a line leave a rotation about it free
BY_POSITIONS = "SE(3) by positions (Umeyama without scale)"
BY_POSES = "SE(3) by poses (rotation averaging, then the mean shift)"
BY_FIRST_POSE = "the first common pose made the same"


def align_positions(estimate: np.ndarray, truth: np.ndarray) -> Alignment:
    """Least squares over camera positions.

    Args:
        estimate, truth: (N, 4, 4) `T_world_camera` of the same frames.

    Raises:
        UserError: fewer than three poses, or positions on one line.
    """
    _check(estimate, truth, 3)
    p, q = estimate[:, :3, 3], truth[:, :3, 3]
    R, _ = _rotation_and_stretch(p, q)
    return Alignment(R, q.mean(axis=0) - R @ p.mean(axis=0), BY_POSITIONS)


def align_similarity(estimate: np.ndarray, truth: np.ndarray) -> tuple[Alignment, float]:
    """Least squares over camera positions with a scale s; arguments and errors as `align_positions`.

    Returns:
        The rigid part, to be applied to s times the estimate's positions, and s.
    """
    _check(estimate, truth, 3)
    p, q = estimate[:, :3, 3], truth[:, :3, 3]
    R, stretch = _rotation_and_stretch(p, q)
    scale = stretch / float(((p - p.mean(axis=0)) ** 2).sum())
    return Alignment(R, q.mean(axis=0) - scale * R @ p.mean(axis=0), "Sim(3) by positions (Umeyama)"), scale


def align_poses(estimate: np.ndarray, truth: np.ndarray) -> Alignment:
    """Rotation averaging over camera orientations, then the mean shift; one pose is enough.

    Args:
        estimate, truth: (N, 4, 4) `T_world_camera` of the same frames.

    Raises:
        UserError: no pose.
    """
    _check(estimate, truth, 1)
    U, _, Vt = np.linalg.svd(np.einsum("nij,nkj->ik", truth[:, :3, :3], estimate[:, :3, :3]))
    R = U @ _handedness(U, Vt) @ Vt
    return Alignment(R, (truth[:, :3, 3] - estimate[:, :3, 3] @ R.T).mean(axis=0), BY_POSES)


def anchor(estimate: np.ndarray, truth: np.ndarray) -> Alignment:
    """Takes the first pose of the estimate to the true one; arguments and errors as `align_poses`."""
    _check(estimate, truth, 1)
    R = truth[0, :3, :3] @ estimate[0, :3, :3].T
    return Alignment(R, truth[0, :3, 3] - R @ estimate[0, :3, 3], BY_FIRST_POSE)


def trajectory_error(estimate: np.ndarray, truth: np.ndarray, alignment: Alignment) -> float:
    """Absolute trajectory error (root mean square of the positions' differences), metres."""
    difference = alignment.apply(estimate[:, :3, 3]) - truth[:, :3, 3]
    return float(np.sqrt((difference**2).sum(axis=1).mean()))


def _rotation_and_stretch(p: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, float]:
    """The rotation from (N, 3) points p to q about their means, and sum of q_i . R p_i about them."""
    U, scales, Vt = np.linalg.svd((q - q.mean(axis=0)).T @ (p - p.mean(axis=0)))
    if not scales[1] > MIN_SPREAD * scales[0]:
        raise UserError("the camera's positions lie on one line: they do not tell the rotation; align by poses")
    signs = _handedness(U, Vt)
    return U @ signs @ Vt, float(scales @ np.diag(signs))


def _handedness(U: np.ndarray, Vt: np.ndarray) -> np.ndarray:
    """Diagonal S with which U S Vt is the nearest rotation, never a reflection."""
    return np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])


def _check(estimate: np.ndarray, truth: np.ndarray, least: int) -> None:
    if estimate.shape != truth.shape or estimate.shape[1:] != (4, 4) or len(estimate) < least:
        shapes = f"{estimate.shape} and {truth.shape}"
        raise UserError(f"need (N, 4, 4) poses of the same N >= {least} frames, got {shapes}")
    if not (np.isfinite(estimate).all() and np.isfinite(truth).all()):
        raise UserError("poses must be finite")
