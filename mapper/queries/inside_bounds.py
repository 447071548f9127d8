"""Bounds of the probability that an uncertain point lies in a convex region, for many points at once.

Fréchet's inequalities need only the probabilities of half-spaces, each a value of the normal distribution function.
Well inside, well outside and at a single face the two bounds meet, and no integral has to be done.
"""

from __future__ import annotations

import numpy as np

from ..map.region import Ball, Box


def inside_bounds(region: Box | Ball, means: np.ndarray, covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest P(x_n in region), (N,) each, for x_n ~ N(mean_n, covariance_n).

    Args:
        region: map frame, metres.
        means: (N, 3) metres.
        covariances: (N, 3, 3) square metres.
    """
    return (
        _box_bounds(region, means, covariances) if isinstance(region, Box) else _ball_bounds(region, means, covariances)
    )


def _box_bounds(box: Box, means: np.ndarray, covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the three events "between two faces": min P and 1 - Σ (1 - P)."""
    stds = np.sqrt(np.maximum(np.einsum("nii->ni", covariances), 0.0))
    between = _below(box.high - means, stds) - _below(box.low - means, stds, inclusive=False)
    return np.maximum(1.0 - (1.0 - between).sum(axis=1), 0.0), between.min(axis=1)


def _ball_bounds(ball: Ball, means: np.ndarray, covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At least that of the ball about the mean that touches from inside, at most that of the half-space that touches
    from outside, both on the line through the two centres."""
    from scipy.special import gammainc

    offset = means - ball.centre
    distance = np.linalg.norm(offset, axis=1)
    room = ball.radius - distance
    directions = offset / np.maximum(distance, 1e-12)[:, None]
    along = np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", directions, covariances, directions), 0.0))
    upper = np.where(distance > 1e-12, _below(room, along), 1.0)
    widest = np.maximum(np.linalg.eigvalsh(covariances)[:, -1], 1e-24)
    lower = np.where(room > 0.0, gammainc(1.5, np.maximum(room, 0.0) ** 2 / (2.0 * widest)), 0.0)  # chi-square of 3
    return np.minimum(lower, upper), upper


def _below(limit: np.ndarray, std: np.ndarray, inclusive: bool = True) -> np.ndarray:
    """P(x <= limit) for x ~ N(0, std^2), elementwise; of what is known exactly 0 or 1."""
    from scipy.special import ndtr

    exact = (limit >= 0.0) if inclusive else (limit > 0.0)
    return np.where(std > 0.0, ndtr(limit / np.where(std > 0.0, std, 1.0)), exact.astype(np.float64))
