"""What pairs of detections and targets cost, as arrays over all pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from ...detectors.boxes import areas, common_areas
from ..config import AssociationConfig
from .lifting import LiftedDetection


@dataclass(frozen=True, slots=True, eq=False)
class DetectionArrays:
    """N lifted detections of one keyframe, column by column.

    Attributes:
        part: (N,) int, `Part` that the box shows.
        xyxy: (N, 4) pixels, the measured boxes; `whole_xyxy` (N, 4) of the objects that they imply.
        confidence: (N,) best scores.
        positions: (N, 3) object centres, world, metres; `covariances` (N, 3, 3).
        ranges: (N,) metres from the camera to the centre; `sigma_range` (N,) metres.
        half_widths: (N,) metres, of the whole objects.
    """

    part: np.ndarray
    xyxy: np.ndarray
    whole_xyxy: np.ndarray
    confidence: np.ndarray
    positions: np.ndarray
    covariances: np.ndarray
    ranges: np.ndarray
    sigma_range: np.ndarray
    half_widths: np.ndarray

    @classmethod
    def of(cls, detections: list[LiftedDetection], T_world_camera: np.ndarray) -> DetectionArrays:
        """The columns of a list, seen from a (4, 4) pose."""
        R = T_world_camera[:3, :3]
        centres = np.array([d.centre for d in detections]).reshape(-1, 3)
        return cls(
            np.array([d.part for d in detections], dtype=int),
            np.array([d.xyxy for d in detections]).reshape(-1, 4),
            np.array([d.whole_xyxy for d in detections]).reshape(-1, 4),
            np.array([d.confidence for d in detections]),
            centres @ R.T + T_world_camera[:3, 3],
            R @ np.array([d.covariance() for d in detections]).reshape(-1, 3, 3) @ R.T,
            np.linalg.norm(centres, axis=1),
            np.array([d.sigma_range for d in detections]),
            np.array([d.half_extents[0] for d in detections]),
        )


def position_costs(
    positions: np.ndarray, covariances: np.ndarray, other_positions: np.ndarray, other_covariances: np.ndarray
) -> np.ndarray:
    """(N, M) squared Mahalanobis distances of N and M Gaussians: positions (., 3) and covariances (., 3, 3)."""
    costs = np.empty((len(positions), len(other_positions)))
    own = np.ascontiguousarray(positions, dtype=float), np.ascontiguousarray(covariances, dtype=float)
    other = np.ascontiguousarray(other_positions, dtype=float), np.ascontiguousarray(other_covariances, dtype=float)
    _mahalanobis(own[0], own[1], other[0], other[1], costs)
    return costs


def alignment_costs(boxes: np.ndarray, predicted: np.ndarray, config: AssociationConfig) -> np.ndarray:
    """(N, M) squared alignment errors of N detected (N, 4) and M predicted (M, 4) boxes of the same part (Ψ_g).

    Errors of the centre are taken over the detection's scale.
    """
    scale, size = box_sides(boxes), box_sides(predicted)
    shift = (_middles(boxes)[:, None] - _middles(predicted)[None]) / scale[:, None, None]
    with np.errstate(divide="ignore"):
        ratio = np.log(size)[None] - np.log(scale)[:, None]
    return (shift**2).sum(axis=2) / config.centre_variance + ratio**2 / config.scale_variance


def box_sides(boxes: np.ndarray) -> np.ndarray:
    """(N,) geometric mean of a box's sides, pixels; 0 for one that is empty or NaN."""
    return np.sqrt(areas(boxes))


def shares_inside(boxes: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(N, M) share of each box's area that lies inside each of the others; 0 where either is NaN."""
    return common_areas(boxes, others) / np.maximum(areas(boxes), 1e-9)[:, None]


def _middles(boxes: np.ndarray) -> np.ndarray:
    return (boxes[:, :2] + boxes[:, 2:]) / 2.0


@njit(cache=True)
def _mahalanobis(positions, covariances, other_positions, other_covariances, costs):
    """Fill costs (N, M) by the adjugate of the summed covariance; infinite where that is singular or NaN."""
    for n in range(len(positions)):
        for m in range(len(other_positions)):
            S = covariances[n] + other_covariances[m]
            d = positions[n] - other_positions[m]
            squared, determinant = 0.0, 0.0
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                diagonal = S[j, j] * S[k, k] - S[j, k] * S[j, k]
                off_diagonal = S[i, k] * S[j, k] - S[i, j] * S[k, k]  # of the pair i, j; every pair comes once
                squared += d[i] * d[i] * diagonal + 2.0 * d[i] * d[j] * off_diagonal
                if i == 0:
                    determinant = S[0, 0] * diagonal + S[0, 1] * off_diagonal
                elif i == 2:
                    determinant += S[0, 2] * off_diagonal  # of the pair 2, 0
            costs[n, m] = squared / determinant if determinant > 0.0 else np.inf
