"""The radius of descriptors, chosen on a validation set (section III-A, note 1)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import rankdata

USUAL = 0.1  # metres; 0.1 and 0.15 did best on rendered tables of seeds below 1000, for all classes alike
TIE = 0.001


def separations(own: np.ndarray, others: np.ndarray) -> np.ndarray:
    """How well scores by each of R radii tell a class from what is not of it.

    The area under the ROC curve: the probability that one of the class scores higher than another, ties counting half.

    Args:
        own: (N, R) scores of what shows the class, NaN for none at all, N > 0.
        others: (M, R) scores of what does not, likewise.

    Returns:
        (R,), 1 where all of the class score higher than any other.
    """
    scores = np.nan_to_num(np.concatenate([own, others]), nan=-np.inf)
    ranks = rankdata(scores, axis=0)  # from 1; ties have their mean
    above = ranks[: len(own)].sum(axis=0) - len(own) * (len(own) + 1) / 2.0
    return above / (len(own) * len(others))


def best_radius(radii: Sequence[float], areas: np.ndarray) -> float:
    """The radius of the greatest area; of those that are no more than `TIE` below it, the one nearest to `USUAL`.

    With few views all candidates tell everything apart, and a small radius sees too little to do so in a scene.

    Args:
        radii: R of them, metres.
        areas: (R,).
    """
    good = [radius for radius, area in zip(radii, areas, strict=True) if area >= areas.max() - TIE]
    return min(good, key=lambda radius: abs(math.log(radius / USUAL)))
