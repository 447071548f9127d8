"""How the kinds of evidence add up to "there is an object, and it is a k".

Meger et al. multiply the terms of their likelihood as if independent (Explicit Occlusion, equation (1), "the Naive
Bayes assumption"). They are not: a box that looks like a mug is also mug-sized, and what was found once is found again
from the next view. So each term enters with a learned power, a composite likelihood:

    log p(k | Z) = log p(k) + w_score log p(scores | k) + w_rate log p(hits, misses | k) + w_free log p(free | k)
                   + w_depth log p(depth | k) + w_size log p(size | k) + const

`thingmap learn` fits the weights to landmarks whose truth is known. All weights 1 is the papers' model.

*Scores.* A box may be named k because its object is of class k, or because something else steadily *looks like* k: a
thing that is no object, or (with probability pi) an object of another class. What looks like k scores as background
does; which k that is, is unknown beforehand:

    L_m = exp(own_m + excess_m),   p(scores | no object) = Σ_m L_m / K
    p(scores | k) = (1 - pi) exp(own_k) + pi Σ_{m≠k} L_m / (K - 1)

so steady naming alone makes nothing an object, nor a wooden stand a microwave when its size speaks against it. How
high an object scores is its own property (a worn book scores low in every view): `excess` grows like correlated
readings, n views counting as n / (1 + rho (n - 1)), Kish's design effect.

*Hits and misses.* How readily a detector finds one particular object is a property of that object too, so misses of
one object are not independent. Its detection rate, relative to P_D, is a latent variable with a Beta prior, wide for
objects and low for what is none, and is integrated out (h hits and m misses, weighted by what should have been seen):

    log p(h, m | object) - log p(h, m | none) = log B(a + h, b + m) / B(a, b) - log B(a0 + h, b0 + m) / B(a0, b0)

*Geometry.* A surface at the place of an object may be anybody's, and that is one fact about the place and not one a
view: free space and depth speak against an object without a limit and for one only once. With S the sum over views and
u the share of the places without an object where a surface looks like one:

    evidence = S - log((1 - u) + u e^S)  <=  -log u
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import betaln


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What is known of N landmarks over K classes; sums over views, each weighted by how new it was.

    Attributes:
        own, excess: (N, K) log p(scores | of class k), and of "only looks like k" over it; relative to a vector in
            which every class scores as a foreign one does.
        score_views: (N,) views with scores.
        hits, misses: (N,) views in which it was detected, and in which it should have been but was not.
        free: (N,) log likelihood of the free ratios, and
        depth: (N,) log ratio of the depths, of an object over none.
        log_size: (N, K + 1) log likelihood of the size, "not an object" first.
    """

    own: np.ndarray
    excess: np.ndarray
    score_views: np.ndarray
    hits: np.ndarray
    misses: np.ndarray
    free: np.ndarray
    depth: np.ndarray
    log_size: np.ndarray


@dataclass(frozen=True, slots=True)
class ExistenceModel:
    """Prior, rates and weights.

    Attributes:
        null_prior: probability that a landmark is no object, before any evidence but that it was proposed.
        object_rate, none_rate: (a, b) of the Beta priors of the detection rate of an object, and of what is none,
            relative to P_D where it was looked at.
        score_correlation: rho, of the score heights of one object's views.
        steady_confusion: pi, share of objects that look like one of another class from every side.
        surface: share of the places without an object where a surface looks like one to the depth camera.
        weight_score, weight_rate, weight_free, weight_depth, weight_size: powers of the terms.

    Raises:
        ValueError: a share that is not between 0 and 1, a rate's parameter that is not positive, a negative weight.
    """

    null_prior: float = 0.5
    object_rate: tuple[float, float] = (4.0, 2.0)
    none_rate: tuple[float, float] = (1.0, 5.0)
    score_correlation: float = 0.5
    steady_confusion: float = 0.1
    surface: float = 0.5
    weight_score: float = 1.0
    weight_rate: float = 1.0
    weight_free: float = 1.0
    weight_depth: float = 1.0
    weight_size: float = 1.0

    def __post_init__(self) -> None:
        for name in ("null_prior", "score_correlation", "steady_confusion", "surface"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise ValueError(f"{name} must be between 0 and 1, but got {getattr(self, name)}")
        for name in ("object_rate", "none_rate"):
            if not all(0.0 < value < np.inf for value in getattr(self, name)):
                raise ValueError(f"{name} must be two positive numbers, but got {getattr(self, name)}")
        for name in ("weight_score", "weight_rate", "weight_free", "weight_depth", "weight_size"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} must not be negative, but got {getattr(self, name)}")

    def log_prior(self, classes: int) -> np.ndarray:
        """(K + 1,) of K classes, "not an object" first."""
        return np.append(np.log(self.null_prior), np.full(classes, np.log1p(-self.null_prior) - np.log(classes)))

    def log_belief(self, evidence: Evidence) -> np.ndarray:
        """(N, K + 1) log p(k | Z) up to a constant a row, "not an object" first."""
        e = evidence
        named, null = self._scores(e)
        bounded = self.weight_free * self._once(e.free) + self.weight_depth * self._once(e.depth)
        existence = self.weight_rate * self.rate_ratio(e.hits, e.misses) + bounded
        likelihood = np.column_stack([null, named + existence[:, None]])
        return self.log_prior(e.own.shape[1]) + likelihood + self.weight_size * e.log_size

    def rate_ratio(self, hits: np.ndarray, misses: np.ndarray) -> np.ndarray:
        """(N,) log p(hits, misses | object) - log p(hits, misses | none), nats."""
        return _log_marginal(self.object_rate, hits, misses) - _log_marginal(self.none_rate, hits, misses)

    def _scores(self, e: Evidence) -> tuple[np.ndarray, np.ndarray]:
        """(N, K) log p(scores | k) and (N,) log p(scores | no object), both to the power w_score."""
        K = e.own.shape[1]
        shrink = 1.0 / (1.0 + self.score_correlation * np.maximum(e.score_views - 1.0, 0.0))
        looks_like = e.own + shrink[:, None] * e.excess
        others = _log_sum_of_others(looks_like) - np.log(max(K - 1, 1))
        named = np.logaddexp(np.log1p(-self.steady_confusion) + e.own, np.log(self.steady_confusion) + others)
        null = _log_sum(looks_like) - np.log(K)
        return self.weight_score * named, self.weight_score * null

    def _once(self, total: np.ndarray) -> np.ndarray:
        """Nats for an object from a sum over views that a mere surface explains as well: S - log(1 - u + u e^S)."""
        empty = 1.0 - self.surface
        return total - np.logaddexp(np.log(empty), np.log(self.surface) + total)


def _log_marginal(prior: tuple[float, float], hits: np.ndarray, misses: np.ndarray) -> np.ndarray:
    a, b = prior
    return betaln(a + hits, b + misses) - betaln(a, b)


def _log_sum(x: np.ndarray) -> np.ndarray:
    """(N,) log Σ_k exp(x_k)."""
    largest = x.max(axis=1)
    return largest + np.log(np.exp(x - largest[:, None]).sum(axis=1))


def _log_sum_of_others(x: np.ndarray) -> np.ndarray:
    """(N, K) log Σ_{m≠k} exp(x_m): the whole sum less one term, but for the largest, where that would cancel."""
    if x.shape[1] < 2:
        return np.full(x.shape, -np.inf)
    rows, largest = np.arange(len(x)), np.argmax(x, axis=1)
    without = x.copy()
    without[rows, largest] = -np.inf
    second = without.max(axis=1)
    rest = second + np.log(np.exp(without - second[:, None]).sum(axis=1))
    top = x[rows, largest]
    e = np.exp(without - top[:, None])
    others = top[:, None] + np.log(np.maximum(1.0 + e.sum(axis=1, keepdims=True) - e, np.finfo(float).tiny))
    others[rows, largest] = rest
    return others
