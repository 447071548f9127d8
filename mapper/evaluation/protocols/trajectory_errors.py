"""Errors of an estimated trajectory against the true one (Sturm et al. 2012, section V).

    ATE   of |S p_i - q_i| over all common frames, S the alignment
    RPE   of E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j): its translation, and the angle of its rotation

P are the estimated and Q the true poses; relative errors need no alignment.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....datasets.stamps import nearest
from ..inputs.case import Alignment

SECOND = 1.0  # s between the poses of a pair
PAIR_TOLERANCE = 0.05  # s by which a pair may miss that: half the distance of two frames at 10 Hz


@dataclass(frozen=True, slots=True)
class ErrorSummary:
    """Of (N,) errors: root mean square, mean, median and largest; None where there is no error."""

    rmse: float | None
    mean: float | None
    median: float | None
    max: float | None

    @classmethod
    def of(cls, errors: np.ndarray) -> ErrorSummary:
        if len(errors) == 0:
            return cls(None, None, None, None)
        mean, median = errors.mean(), np.median(errors)
        return cls(float(np.sqrt((errors**2).mean())), float(mean), float(median), float(errors.max()))


def absolute_errors(estimate: np.ndarray, truth: np.ndarray, alignment: Alignment, scale: float = 1.0) -> np.ndarray:
    """(N,) metres between the positions of (N, 4, 4) poses, those of the estimate scaled and then aligned."""
    return np.linalg.norm(alignment.apply(scale * estimate[:, :3, 3]) - truth[:, :3, 3], axis=1)


def relative_errors(estimate: np.ndarray, truth: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each of (P, 2) pairs of rows in (N, 4, 4) poses: (P,) metres and (P,) radians."""
    i, j = np.asarray(pairs, dtype=np.intp).reshape(-1, 2).T
    error = np.linalg.inv(np.linalg.inv(truth[i]) @ truth[j]) @ (np.linalg.inv(estimate[i]) @ estimate[j])
    return np.linalg.norm(error[:, :3, 3], axis=1), rotation_angles(error)


def rotation_angles(poses: np.ndarray) -> np.ndarray:
    """(N,) radians that (N, 4, 4) poses turn by; exact for small angles too, where an arc cosine is not."""
    skew = poses[:, [2, 0, 1], [1, 2, 0]] - poses[:, [1, 2, 0], [2, 0, 1]]
    return np.arctan2(np.linalg.norm(skew, axis=1), np.trace(poses[:, :3, :3], axis1=1, axis2=2) - 1.0)


def neighbours(count: int) -> np.ndarray:
    """(count - 1, 2) pairs of rows that follow each other."""
    return np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)


def pairs_apart(stamps: np.ndarray, seconds: float = SECOND) -> np.ndarray:
    """(P, 2) rows i, j: for each i the stamp nearest to so many seconds later, where within `PAIR_TOLERANCE`.

    `stamps` (N,) are sorted, `seconds` are more than the tolerance.
    """
    partner = nearest(stamps + seconds, stamps, PAIR_TOLERANCE)
    first = np.flatnonzero(partner >= 0)
    return np.stack([first, partner[first]], axis=1)
