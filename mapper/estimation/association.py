"""Which detection shows which landmark or candidate.

The cost of a pair is minus twice its log likelihood up to a constant: depth position (Mahalanobis distance), box
alignment Ψ_g (Meger et al., Clutter, III-D: centre error over the detection's scale, error of scale) and the class as
evidence, never as a gate. The cheapest one-to-one assignment is found by the Hungarian method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..config import AssociationConfig
from .lifting import LiftedDetection

IMPOSSIBLE = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """What could be seen in this keyframe: landmarks first, then candidates.

    Attributes:
        positions: (M, 3) world, metres; `covariances` (M, 3, 3).
        log_sizes: (M, 3) log half-axes, upright frame.
        xyxy: (M, 4) pixels, projected boxes clipped to the image; NaN where not in front of the camera.
        visible: (M,) share inside the image and not occluded.
        side_px: (M,) geometric mean of the clipped box's sides.
    """

    positions: np.ndarray
    covariances: np.ndarray
    log_sizes: np.ndarray
    xyxy: np.ndarray
    visible: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def side_px(self) -> np.ndarray:
        """(M,) geometric mean of the projected box's sides, pixels; 0 where it is not in view."""
        sides = np.maximum(np.nan_to_num(self.xyxy[:, 2:] - self.xyxy[:, :2]), 0.0)
        return np.sqrt(sides.prod(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class Assignment:
    """Result of an association.

    Attributes:
        target: (N,) index of the target each detection shows, -1 where none.
        duplicate_of: (N,) index of the target on which an unassigned detection is a second box, -1 where none.
    """

    target: np.ndarray
    duplicate_of: np.ndarray


def associate(
    detections: list[LiftedDetection],
    targets: Targets,
    class_evidence: np.ndarray,
    T_world_camera: np.ndarray,
    R_world_upright: np.ndarray,
    config: AssociationConfig,
) -> Assignment:
    """One-to-one assignment of detections to targets.

    Args:
        detections: of one keyframe.
        targets: as predicted in it.
        class_evidence: (N, M) log likelihood ratio of each detection's scores under each target's class posterior
            against a new object, nats.
        T_world_camera: (4, 4) predicted pose.
        R_world_upright: (3, 3) frame of the volumes.
        config: gates and weights.
    """
    n, m = len(detections), len(targets)
    none = np.full(n, -1)
    if n == 0 or m == 0:
        return Assignment(none, none.copy())
    position = _position_cost(detections, targets, T_world_camera)
    cost = position + _box_cost(detections, targets, config) - 2.0 * config.class_weight * class_evidence
    cost[(position > config.gate) | (targets.visible < config.min_visible)[None, :] | ~np.isfinite(cost)] = IMPOSSIBLE
    rows, columns = linear_sum_assignment(np.hstack([cost, np.full((n, n), config.new_cost)]))
    target = none.copy()
    accepted = columns < m
    target[rows[accepted]] = columns[accepted]
    return Assignment(target, _duplicates(detections, targets, target, T_world_camera, R_world_upright, config))


def _position_cost(detections: list[LiftedDetection], targets: Targets, T: np.ndarray) -> np.ndarray:
    """(N, M) squared Mahalanobis distances of depth positions."""
    R = T[:3, :3]
    centres = np.array([d.centre for d in detections]) @ R.T + T[:3, 3]
    covariances = R @ np.array([d.covariance() for d in detections]) @ R.T
    difference = centres[:, None] - targets.positions[None]
    information = np.linalg.inv(covariances[:, None] + targets.covariances[None])
    return np.einsum("nmi,nmij,nmj->nm", difference, information, difference)


def _box_cost(detections: list[LiftedDetection], targets: Targets, config: AssociationConfig) -> np.ndarray:
    """(N, M) squared alignment errors of boxes, both clipped to the image."""
    boxes = np.array([d.xyxy for d in detections])
    centre, sides = (boxes[:, :2] + boxes[:, 2:]) / 2.0, boxes[:, 2:] - boxes[:, :2]
    scale = np.sqrt(sides.prod(axis=1))
    predicted = (targets.xyxy[:, :2] + targets.xyxy[:, 2:]) / 2.0
    shift = (centre[:, None] - predicted[None]) / scale[:, None, None]
    with np.errstate(divide="ignore"):
        ratio = np.log(targets.side_px)[None] - np.log(scale)[:, None]
    return (shift**2).sum(axis=2) / config.centre_variance + ratio**2 / config.scale_variance


def _duplicates(
    detections: list[LiftedDetection],
    targets: Targets,
    target: np.ndarray,
    T: np.ndarray,
    R_world_upright: np.ndarray,
    config: AssociationConfig,
) -> np.ndarray:
    """A box without target that lies on a target, in the image and in space, is a second box on it."""
    result = np.full(len(detections), -1)
    half_axes = np.exp(targets.log_sizes)
    for i in np.flatnonzero(target < 0):
        detection = detections[i]
        inside = _share_inside(detection.xyxy, targets.xyxy)
        centre = T[:3, :3] @ detection.centre + T[:3, 3]
        reach = half_axes * 1.2 + detection.sigma_range
        offset = np.linalg.norm((centre - targets.positions) @ R_world_upright / reach, axis=1)
        # a much smaller thing at the same place is another one: a mug on a table
        alike = np.sqrt((detection.xyxy[2:] - detection.xyxy[:2]).prod()) > config.duplicate_scale * targets.side_px
        candidates = (inside > config.duplicate_overlap) & (offset < 1.0) & alike & (targets.visible > 0.0)
        if candidates.any():
            result[i] = int(np.argmin(np.where(candidates, offset, np.inf)))
    return result


def _share_inside(box: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(M,) share of a box's area that lies inside each of the others."""
    size = np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])
    return np.nan_to_num(np.maximum(size, 0.0).prod(axis=1)) / max((box[2:] - box[:2]).prod(), 1e-9)
