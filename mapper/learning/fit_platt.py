"""Platt scaling: the probability that a detection with a score shows an object.

J. Platt, Probabilistic outputs for support vector machines (1999): 1 / (1 + exp(A s + B)) fitted by maximum likelihood
to targets that are not quite 0 and 1, (N+ + 1) / (N+ + 2) and 1 / (N- + 2), so that it stays finite where the two kinds
can be told apart without a mistake.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit


def fit_platt(right: np.ndarray, false: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """(2,) A and B from the scores of right (P,) and false (Q,) detections; `otherwise` where either has none."""
    P, Q = len(right), len(false)
    if not P or not Q:
        return np.asarray(otherwise)
    score = np.concatenate([right, false])
    target = np.concatenate([np.full(P, (P + 1.0) / (P + 2.0)), np.full(Q, 1.0 / (Q + 2.0))])

    def loss(ab: np.ndarray) -> tuple[float, np.ndarray]:
        z = ab[0] * score + ab[1]
        value = np.sum(np.logaddexp(0.0, z) - (1.0 - target) * z)
        slope = expit(z) - (1.0 - target)
        return float(value), np.array([slope @ score, slope.sum()])

    start = np.array([0.0, np.log((Q + 1.0) / (P + 1.0))])
    return minimize(loss, start, jac=True, method="BFGS").x
