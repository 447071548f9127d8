"""How the kinds of evidence add up to "there is an object, and it is a k".

Meger et al. multiply the terms of their likelihood as if independent (Explicit Occlusion, equation (1), "the Naive
Bayes assumption"). They are not: a box that looks like a mug is also mug-sized, and what was found once is found again
from the next view. So each term enters with a learned power, a composite likelihood,

    log p(k | Z) = log p(k) + w_score log p(scores | k) + w_rate log p(hits, misses | k) + w_free log p(free | k)
                   + w_depth log p(depth | k) + w_size log p(size | k) + const,

whose weights `thingmap learn` fits to landmarks whose truth is known. All weights 1 is the papers' model.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ExistenceModel:
    """Prior, rates and weights.

    Attributes:
        null_prior: probability that a landmark is no object, before any evidence but that it was proposed.
        object_rate, none_rate: (a, b) of the Beta priors of the detection rate of an object, and of what is none,
            relative to P_D where it was looked at.
        weight_score, weight_rate, weight_free, weight_depth, weight_size: powers of the terms.
    """

    null_prior: float = 0.5
    object_rate: tuple[float, float] = (4.0, 2.0)
    none_rate: tuple[float, float] = (1.0, 5.0)
    weight_score: float = 1.0
    weight_rate: float = 1.0
    weight_free: float = 1.0
    weight_depth: float = 1.0
    weight_size: float = 1.0
