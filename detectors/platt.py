"""Platt scaling: the probability that a window with a score shows what its classifier looks for.

J. Platt, Probabilistic outputs for support vector machines (1999), by the Newton method of H.-T. Lin, C.-J. Lin and
R. C. Weng, A note on Platt's probabilistic outputs for support vector machines (2007).
"""

from __future__ import annotations

import numpy as np
from scipy.special import expit

MOST_STEPS = 100  # of Newton's method; it takes about ten
LEAST_STEP = 1e-10  # share of a Newton step below which no shorter one is tried
FLAT = 1e-10  # slope of the loss per unit of weight at which it is done


def probability(score: np.ndarray | float, u: float, v: float) -> np.ndarray:
    """p = 1 / (1 + exp(u score + v)) for scores of any shape; it does not overflow."""
    return expit(-(u * np.asarray(score) + v))


def fit_platt(scores: np.ndarray, labels: np.ndarray, weights: np.ndarray | None = None) -> tuple[float, float]:
    """(u, v) of `probability`, of most likelihood under the smoothed targets (N+ + 1) / (N+ + 2) and 1 / (N- + 2).

    The targets keep the curve finite where the two kinds can be told apart without a mistake. A probability never falls
    as the score rises: where the scores say less than nothing, u is 0 and p is the share of positives.

    Args:
        scores: (N,), N > 0.
        labels: (N,) True where the window shows what is looked for.
        weights: (N,) how often each counts, 1 by default: a window of weight 3 is three alike. To calibrate for another
            share of positives than that of the sample, weigh one kind; N+ and N- are the sums of the weights.

    Raises:
        ValueError: for shapes that differ, a number that is not finite, or no weight at all.
    """
    scores, positive = np.asarray(scores, dtype=np.float64), np.asarray(labels, dtype=bool)
    weights = np.ones(len(scores)) if weights is None else np.asarray(weights, dtype=np.float64)
    if scores.ndim != 1 or not scores.shape == positive.shape == weights.shape:
        raise ValueError(
            f"scores, labels and weights must be (N,), but got {scores.shape}, {positive.shape}, {weights.shape}"
        )
    if not (np.isfinite(scores).all() and np.isfinite(weights).all() and (weights >= 0).all() and weights.sum() > 0):
        raise ValueError("scores must be finite, and weights finite, not negative and not all zero")
    many, few = weights[positive].sum(), weights[~positive].sum()
    target = np.where(positive, (many + 1.0) / (many + 2.0), 1.0 / (few + 2.0))
    share = float(weights @ target / weights.sum())
    constant = (0.0, float(np.log((1.0 - share) / share)))

    # In units of their own spread: the same fit whatever an SVM's margin is worth.
    centre = float(weights @ scores / weights.sum())
    spread = float(np.sqrt(weights @ (scores - centre) ** 2 / weights.sum()))
    if spread <= 1e-12 * max(1.0, abs(centre)):
        return constant
    u, v = _newton((scores - centre) / spread, target, weights, constant)
    return (u / spread, v - u * centre / spread) if u < 0.0 else constant


def _newton(z: np.ndarray, target: np.ndarray, weights: np.ndarray, start: tuple[float, float]) -> tuple[float, float]:
    """(u, v) of least cross entropy - Σ w (t log p + (1 - t) log(1 - p)), which is convex; backtracking line search."""
    design = np.stack([z, np.ones_like(z)], axis=1)

    def loss(parameters: np.ndarray) -> float:
        exponent = design @ parameters
        return float(weights @ (np.logaddexp(0.0, exponent) - (1.0 - target) * exponent))

    current = np.array(start)
    value = loss(current)
    for _ in range(MOST_STEPS):
        p = expit(-(design @ current))
        gradient = design.T @ (weights * (target - p))
        if np.abs(gradient).max() <= FLAT * weights.sum():
            break
        hessian = (design * (weights * p * (1.0 - p))[:, None]).T @ design + 1e-12 * np.eye(2)
        step = -np.linalg.solve(hessian, gradient)
        length = 1.0
        while loss(current + length * step) > value + 1e-4 * length * float(gradient @ step):
            length /= 2.0
            if length < LEAST_STEP:
                return float(current[0]), float(current[1])
        current = current + length * step
        value = loss(current)
    return float(current[0]), float(current[1])
