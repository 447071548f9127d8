"""Platt scaling of what was collected: the probability that a detection with a score shows an object."""

from __future__ import annotations

import numpy as np

from ...detectors import platt


def fit_platt(right: np.ndarray, false: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """(2,) A and B of 1 / (1 + exp(A s + B)), as `detectors.platt.fit_platt` finds them; A is never above 0.

    Args:
        right: (P,) scores of detections of objects.
        false: (Q,) scores of false detections.
        otherwise: (2,) A and B where one kind has no detection.
    """
    if not len(right) or not len(false):
        return np.asarray(otherwise)
    shows = np.repeat([True, False], [len(right), len(false)])
    return np.array(platt.fit_platt(np.concatenate([right, false]), shows))
