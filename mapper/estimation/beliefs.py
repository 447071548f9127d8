"""What a landmark is and whether it is: class and existence, coupled to its size by expectation propagation.

The joint posterior of class c and log size s of one landmark is
    p(c, s | all) ∝ p(c) p(evidence | c) N(s; μ_c, Σ_c) · (what the graph says about s)
The graph holds a single Gaussian *site* on S in place of the class mixture. Each refresh divides the site out of the
graph's marginal (the cavity), multiplies the exact mixture in, and projects the result back onto a Gaussian:
    q_c ∝ p(c) p(evidence | c) Z_c,  Z_c = ∫ N(s; μ_c, Σ_c) cavity(s) ds,  site ← moments(Σ_c q_c ·) / cavity
Class 0 is "not an object"; existence is 1 - q_0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...factors.appearance import ScoreEvidence
from ...factors.free_space import FreeSpace
from ...factors.missed import DetectionRate
from ...factors.size_prior import ClassSizePriors
from ..config import BeliefConfig

MIN_INFORMATION = 1e-3  # of a site, 1/log-unit^2: a site never takes information away


@dataclass(frozen=True, slots=True, eq=False)
class SizeSite:
    """Gaussian stand-in for the class mixture on log half-axes: (3,) mean and (3, 3) information."""

    mean: np.ndarray
    information: np.ndarray

    def distance(self, other: SizeSite) -> float:
        """How much another site differs: Mahalanobis distance of the means plus change of log volume."""
        difference = other.mean - self.mean
        volume = np.linalg.slogdet(other.information)[1] - np.linalg.slogdet(self.information)[1]
        return float(difference @ self.information @ difference + abs(volume))


@dataclass(frozen=True, slots=True, eq=False)
class Refreshed:
    """Result of one expectation propagation step.

    Attributes:
        posterior: (K+1,) class probabilities, "not an object" first.
        log_z: (K+1,) log evidence of the size under each class.
        site: the new site.
        mean, covariance: (3,), (3, 3) of the log size under the exact mixture.
    """

    posterior: np.ndarray
    log_z: np.ndarray
    site: SizeSite
    mean: np.ndarray
    covariance: np.ndarray


def initial_site(priors: ClassSizePriors, posterior: np.ndarray) -> SizeSite:
    """The class mixture's own moments: the site of a landmark whose size nobody has measured."""
    mean, covariance = _moments(posterior, priors.mean, priors.covariance)
    return SizeSite(mean, np.linalg.inv(covariance))


def propagate(
    mean: np.ndarray,
    covariance: np.ndarray,
    site: SizeSite,
    log_belief: np.ndarray,
    priors: ClassSizePriors,
    outlier: float = 0.0,
) -> Refreshed:
    """One expectation propagation step.

    Args:
        mean, covariance: (3,), (3, 3) of the graph's marginal on the log size, the site included.
        site: the site that the graph holds now.
        log_belief: (K+1,) log prior plus log evidence of each class, up to a constant.
        priors: class size priors.
        outlier: share of objects of which only a part is ever measured (a chair behind a table): their size follows
            the wide prior of class 0, so that no size alone can rule a class out.
    """
    information = np.linalg.inv(covariance)
    cavity = _positive(information - site.information, 1e-6)
    vector = information @ mean - site.information @ site.mean
    log_z, means, covariances = priors.log_evidence(cavity, vector)
    log_z, share = _with_outliers(log_z, outlier)
    posterior = _softmax(log_z + log_belief)
    weights = posterior * (1.0 - share)
    weights[0] += posterior @ share
    mixed_mean, mixed_covariance = _moments(weights, means, covariances)
    site = _divide(mixed_mean, mixed_covariance, cavity, vector)
    return Refreshed(posterior, log_z, site, mixed_mean, mixed_covariance)


def _divide(mean: np.ndarray, covariance: np.ndarray, cavity: np.ndarray, vector: np.ndarray) -> SizeSite:
    """The Gaussian that turns the cavity (information, information vector) into the given moments.

    Where the moments are wider than the cavity no such Gaussian exists: in those directions the site is next to
    nothing, centred on the mean. (Keeping the mean exactly would take a site of little information infinitely far away,
    which pulls for ever.)
    """
    target = np.linalg.inv(covariance)
    values, axes = np.linalg.eigh((target - cavity + (target - cavity).T) / 2.0)
    along = axes.T @ (target @ mean - vector)
    clamped = values < MIN_INFORMATION
    values = np.where(clamped, MIN_INFORMATION, values)
    along = np.where(clamped, MIN_INFORMATION * (axes.T @ mean), along)
    return SizeSite(axes @ (along / values), (axes * values) @ axes.T)


class ViewHistory:
    """From where an object has been seen, to tell new evidence from the same view again."""

    MAX_VIEWS = 64

    def __init__(self, config: BeliefConfig) -> None:
        self._config = config
        self._directions = np.empty((0, 3))
        self._log_ranges = np.empty(0)

    def weight(self, object_to_camera: np.ndarray) -> float:
        """Weight in (0, 1] of a view from (3,) metres off the object; remembers views that add something.

        Georgakis et al. (eq. 2) multiply per-view distributions as if independent; near-identical views are not.
        """
        c = self._config
        distance = max(float(np.linalg.norm(object_to_camera)), 1e-3)
        direction, log_range = object_to_camera / distance, np.log(distance)
        novelty = 1.0
        if len(self._log_ranges):
            angle = np.arccos(np.clip(self._directions @ direction, -1.0, 1.0)) / c.view_angle
            novelty = min(1.0, float(np.hypot(angle, (self._log_ranges - log_range) / c.view_log_range).min()))
        if novelty > 0.3 and len(self._log_ranges) < self.MAX_VIEWS:
            self._directions = np.vstack([self._directions, direction])
            self._log_ranges = np.append(self._log_ranges, log_range)
        return max(c.min_weight, novelty)

    def absorb(self, other: ViewHistory) -> None:
        """Takes over the views of a landmark merged into this one's; their directions are seen already."""
        room = self.MAX_VIEWS - len(self._log_ranges)
        self._directions = np.vstack([self._directions, other._directions[:room]])
        self._log_ranges = np.append(self._log_ranges, other._log_ranges[:room])


class Belief:
    """Everything but geometry that is known about one landmark."""

    def __init__(self, classes: int, config: BeliefConfig, rate: DetectionRate, free_space: FreeSpace) -> None:
        self._config, self._rate, self._free_space = config, rate, free_space
        self.views = ViewHistory(config)
        self.own = np.zeros(classes)
        self.excess = np.zeros(classes)  # of "only looks like class k" over "is of class k"
        self.score_views = 0.0
        self.hits = self.misses = self.free = 0.0
        self.log_z = np.zeros(classes + 1)
        self.posterior = _softmax(self.log_belief())

    def add_scores(self, evidence: ScoreEvidence, weight: float) -> None:
        """A detection's scores, seen with the given view weight."""
        if not (evidence.own.any() or evidence.background.any()):
            return  # the object was hidden: a view that says nothing is none
        self.own += weight * evidence.own
        self.excess += weight * (evidence.background - evidence.own)
        self.score_views += weight

    def add_view(self, hits: float, misses: float, free: float) -> None:
        """Weighted hits and misses, and the weighted log likelihood of a view's free ratio."""
        self.hits += hits
        self.misses += misses
        self.free += free

    def absorb(self, other: Belief) -> None:
        """Takes over the evidence of a landmark merged into this one."""
        self.own += other.own
        self.excess += other.excess
        self.score_views += other.score_views
        self.views.absorb(other.views)
        self.add_view(other.hits, other.misses, other.free)

    def log_belief(self) -> np.ndarray:
        """(K+1,) log prior and evidence without size.

        A box may be named k because its object is of class k, or because something else steadily *looks like* k: a
        thing that is no object, or (with probability π) an object of another class. What looks like k scores as
        background does; which k that is, is unknown beforehand:

            L_m = exp(own_m + excess_m),   p(scores | no object) = Σ_m L_m / K
            p(scores | k) = (1 - π) exp(own_k) + π Σ_{m≠k} L_m / (K - 1)

        so steady naming alone makes nothing an object, nor a wooden stand a microwave when its size speaks against it.
        How high an object scores is its own property (a worn book scores low in every view): `excess` grows like
        correlated readings, n views counting as n / (1 + ρ (n - 1)), Kish's design effect.
        """
        count, c = len(self.own), self._config
        shrink = 1.0 / (1.0 + c.score_correlation * max(self.score_views - 1.0, 0.0))
        looks_like = self.own + shrink * self.excess
        others = _log_sum_of_others(looks_like) - np.log(max(count - 1, 1))
        named = np.logaddexp(np.log1p(-c.steady_confusion) + self.own, np.log(c.steady_confusion) + others)
        existence = self._rate.log_ratio(self.hits, self.misses) + self._free_space.evidence(self.free)
        null = np.log(c.null_prior) + _log_sum(looks_like) - np.log(count)
        return np.append(null, np.log1p(-c.null_prior) - np.log(count) + named + existence)

    def update(self, log_z: np.ndarray | None = None) -> None:
        """Posterior from the evidence and the (given or last known) size evidence."""
        if log_z is not None:
            self.log_z = log_z
        self.posterior = _softmax(self.log_belief() + self.log_z)

    @property
    def existence(self) -> float:
        """P(it is an object)."""
        return float(1.0 - self.posterior[0])

    @property
    def effective_views(self) -> float:
        """Sum of the view weights in which it was seen or should have been."""
        return self.hits + self.misses

    def class_posterior(self) -> np.ndarray:
        """(K,) class probabilities given that it is an object."""
        conditional = self.posterior[1:]
        total = conditional.sum()
        return conditional / total if total > 0 else np.full(len(conditional), 1.0 / len(conditional))


def _with_outliers(log_z: np.ndarray, outlier: float) -> tuple[np.ndarray, np.ndarray]:
    """(K+1,) log evidence of each class's size prior mixed with the wide one, and the wide one's share in it."""
    if outlier <= 0.0:
        return log_z, np.zeros(len(log_z))
    wide = np.log(outlier) + log_z[0]
    mixed = np.logaddexp(np.log1p(-outlier) + log_z, wide)
    mixed[0] = log_z[0]
    share = np.exp(wide - mixed)
    share[0] = 0.0
    return mixed, share


def _moments(weights: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    mean = weights @ means
    difference = means - mean
    covariance = np.einsum("k,kij->ij", weights, covariances) + (weights[:, None] * difference).T @ difference
    return mean, covariance


def _log_sum_of_others(x: np.ndarray) -> np.ndarray:
    """(K,) log Σ_{m≠k} exp(x_m): the whole sum less one term, but for the largest, where that would cancel."""
    if len(x) < 2:
        return np.full(len(x), -np.inf)
    largest = int(np.argmax(x))
    e = np.exp(x - x[largest])
    rest = np.delete(x, largest)
    others = x[largest] + np.log(np.maximum(e.sum() - e, np.finfo(float).tiny))
    others[largest] = rest.max() + np.log(np.exp(rest - rest.max()).sum())
    return others


def _log_sum(x: np.ndarray) -> float:
    """log Σ exp(x_k); scipy's costs a hundred times more on small arrays."""
    largest = float(x.max())
    return largest + float(np.log(np.exp(x - largest).sum()))


def _positive(matrix: np.ndarray, floor: float) -> np.ndarray:
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2.0)
    return (vectors * np.maximum(values, floor)) @ vectors.T


def _softmax(x: np.ndarray) -> np.ndarray:
    e = np.exp(x - x.max())
    return e / e.sum()
