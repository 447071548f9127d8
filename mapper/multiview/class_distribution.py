"""Distributions over classes and the background: p(y) of one view, and Bayes' rule over views."""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp


def class_distribution(scores: np.ndarray, least: float) -> np.ndarray:
    """What one view says of each of N detections, p(y) (Georgakis et al., section III-B).

    A detector's scores are the classes' probabilities and what they leave is the background's. Independent scores that
    add up to more than 1 are divided by their sum and leave none.

    Args:
        scores: (N, K) in [0, 1]; NaN is 0.
        least: probability that everything has before the rows are made to add up to 1 again: no view is so sure that
            it would make a class impossible for ever.

    Returns:
        (N, K + 1), the background last; rows add up to 1.
    """
    known = np.nan_to_num(np.asarray(scores, dtype=np.float64), nan=0.0)
    known = known / np.maximum(known.sum(axis=1, keepdims=True), 1.0)
    rest = 1.0 - known.sum(axis=1, keepdims=True)
    distribution = np.maximum(np.concatenate([known, rest], axis=1), least)
    return distribution / distribution.sum(axis=1, keepdims=True)


def bayes_update(log_prior: np.ndarray, log_likelihood: np.ndarray) -> np.ndarray:
    """Equation (2), in logs: p(C | y^1..n) = p(y^n | C) p(C | y^1..n-1) / sum over C of the same.

    Args:
        log_prior: (..., C) log p(C | y^1..n-1).
        log_likelihood: (..., C) log p(y^n | C).

    Returns:
        (..., C) log p(C | y^1..n).
    """
    joint = log_prior + log_likelihood
    return joint - logsumexp(joint, axis=-1, keepdims=True)
