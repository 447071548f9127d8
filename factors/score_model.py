"""What a detector's scores say, given how much of the object was hidden: learned for each class and template.

Meger et al., Mobile 3D Object Detection in Clutter, sections III-D and IV: the score of an object's own class is a
Gaussian whose mean and standard deviation are learned in bins of occlusion of width 0.1 and interpolated linearly
between them. The scores of false detections form a background distribution. Above an occlusion of 0.7 the model is
truncated: "we expect the detector to respond as if no object was present", so such a view says nothing. Every template
of Explicit Occlusion, section 2.3 (the whole object and its halves) has Gaussians of its own. Scores lie in [0, 1], so
the Gaussians are cut off and normalised there.

With H the half-normal density of the scores of classes that the object is not of, and c the share of detections of an
object that name another class (any score, any other class alike), the densities of the score s_k of class k are

    own_k(s)        = (1 - c) N(s; mean_k(occlusion), sigma_k(occlusion)) + c H(s)
    background_k(s) = N(s; background_mean_k, background_sigma_k)
    other_k(s)      = (1 - c / (K - 1)) H(s) + c / (K - 1)

and the evidence is log own / other and log background / other, which makes the K scores of one detection comparable.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.special import expit

from .learned_numbers import TEMPLATES, checked_array, rows_of

TRUNCATION = 0.7  # occlusion above which an object counts as fully hidden (Clutter, IV)
BINS = 10  # of occlusion, of width 0.1 (Clutter, IV)
BIN_CENTRES = (np.arange(BINS) + 0.5) / BINS
SCORE = (0.0, 1.0)
SIGMA = (1e-3, 10.0)  # a narrower Gaussian would be a spike; a wider one is flat between 0 and 1
PER_CLASS = {  # shape of a row, and limits
    "mean": ((TEMPLATES, BINS), SCORE),
    "sigma": ((TEMPLATES, BINS), SIGMA),
    "background_mean": ((TEMPLATES,), SCORE),
    "background_sigma": ((TEMPLATES,), SIGMA),
}
PER_TEMPLATE = {  # shape, and limits
    "other_sigma": ((TEMPLATES,), SIGMA),
    "confusion": ((TEMPLATES,), (0.0, 1.0)),
    "platt_ab": ((TEMPLATES, 2), (-1e4, 1e4)),
    "linear_range": ((TEMPLATES, 2), SCORE),
}
_FLOOR = 1e-6  # of a density, so that its logarithm stays finite
_LEAST_BEST = 1e-3  # classes that were not reported are averaged over scores up to here at least


@dataclass(frozen=True, slots=True, eq=False)
class ScoreEvidence:
    """What one score vector says, nats, relative to a vector in which every class scores as a foreign class does.

    Attributes:
        own: (K,) for "the object is of class k".
        background: (K,) for "there is no object, but something that looks like class k".
    """

    own: np.ndarray
    background: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class ScoreModel:
    """Densities of scores in [0, 1] by class, template (`VolumePart`) and occlusion.

    Rows 0 to K - 1 are `classes`; row K is pooled over all classes.

    Attributes:
        classes: K names.
        mean, sigma: (K + 1, 5, 10) of the own-class score in the bins of occlusion centred on 0.05, 0.15, ..., 0.95.
        background_mean, background_sigma: (K + 1, 5) of the top score of false detections that name the class.
        other_sigma: (5,) half-normal scale of the scores of classes that the object is not of.
        confusion: (5,) share of the detections of an object that name another class.
        platt_ab: (5, 2) A, B of `platt`.
        linear_range: (5, 2) the scores that `linear` maps to -1 and to 1.

    Raises:
        ValueError: an array is of another shape, or a number is out of its limits.
    """

    classes: tuple[str, ...]
    mean: np.ndarray
    sigma: np.ndarray
    background_mean: np.ndarray
    background_sigma: np.ndarray
    other_sigma: np.ndarray
    confusion: np.ndarray
    platt_ab: np.ndarray
    linear_range: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "classes", tuple(self.classes))
        rows = len(self.classes) + 1
        for name, (shape, limits) in (PER_CLASS | PER_TEMPLATE).items():
            shape = (rows, *shape) if name in PER_CLASS else shape
            object.__setattr__(self, name, checked_array(name, getattr(self, name), shape, limits))
        low, high = self.linear_range.T
        if not (low < high).all():
            raise ValueError(
                f"linear_range {self.linear_range.tolist()} with a first score that is not the smaller one"
            )

    def bind(self, classes: Sequence[str]) -> ScoreModel:
        """The model of a detector's classes, in its order; the pooled row for those that were not learned.

        Names compare without case, `_` and `-`.
        """
        rows = rows_of(self.classes, classes)
        return replace(self, classes=tuple(classes), **{name: getattr(self, name)[rows] for name in PER_CLASS})

    def own_parameters(self, part: int, occlusion: float) -> tuple[np.ndarray, np.ndarray]:
        """(K + 1,) mean and (K + 1,) standard deviation of the own-class score at this ratio of occluded pixels.

        Linear between the centres of the bins, constant beyond the outer two.
        """
        place = min(max(occlusion * BINS - 0.5, 0.0), BINS - 1.0)
        left = min(int(place), BINS - 2)
        share = np.array([left + 1.0 - place, place - left])
        return self.mean[:, part, left : left + 2] @ share, self.sigma[:, part, left : left + 2] @ share

    def evidence(self, scores: np.ndarray, occlusion: float, part: int = 0) -> ScoreEvidence:
        """Evidence of one detection's scores.

        Args:
            scores: (K,) by class; NaN for classes that the detector did not report: they scored below the best one,
                and the densities are averaged up to there.
            occlusion: ratio of occluded pixels of the template. Above 0.7, or where not known (NaN), the scores say
                nothing (zeros); so do scores that are all NaN.
            part: template that found the object.

        Raises:
            ValueError: there are not K scores.
        """
        scores = np.array(scores, dtype=np.float64)  # a copy: one memory layout, one compiled kernel
        if scores.shape != (len(self.classes),):
            raise ValueError(f"scores must be ({len(self.classes)},), one for each class, but got {scores.shape}")
        own, background = np.zeros(len(scores)), np.zeros(len(scores))
        if occlusion <= TRUNCATION:
            gaussians = *self.own_parameters(part, occlusion), self.background_mean, self.background_sigma
            _log_ratios(scores, int(part), *gaussians, self.other_sigma[part], self.confusion[part], own, background)
        return ScoreEvidence(own, background)

    def linear(self, score: np.ndarray, part: int = 0) -> np.ndarray:
        """(N,) potential Psi_s in [-1, 1] of (N,) scores (Explicit Occlusion, section 2.3).

        The paper maps scores linearly "based on scores on a set of validation data": here the mean score of false
        detections becomes -1 and that of objects in full view 1; scores beyond them are clipped.
        """
        low, high = self.linear_range[part]
        return np.clip(2.0 * (np.asarray(score) - low) / (high - low) - 1.0, -1.0, 1.0)

    def platt(self, score: np.ndarray, part: int = 0) -> np.ndarray:
        """(N,) probability that detections with (N,) scores show an object, 1 / (1 + exp(A score + B)) (Platt 1999)."""
        A, B = self.platt_ab[part]
        return expit(-(A * np.asarray(score, dtype=np.float64) + B))


@njit(cache=True)
def _log_ratios(scores, part, mean, sigma, background_mean, background_sigma, other_sigma, confusion, own, background):
    """Fill log own / other and log background / other of every class; leave them where no class is reported."""
    best = np.nanmax(scores) if np.any(~np.isnan(scores)) else np.nan
    if np.isnan(best):
        return
    up_to = min(max(best, _LEAST_BEST), 1.0)
    named_by_mistake = confusion / max(len(scores) - 1, 1)
    for k in range(len(scores)):
        at = min(max(scores[k], 0.0), 1.0)  # NaN for a class that was not reported
        foreign = _density(at, up_to, 0.0, other_sigma)
        other = (1.0 - named_by_mistake) * foreign + named_by_mistake + _FLOOR
        false = _density(at, up_to, background_mean[k, part], background_sigma[k, part])
        right = (1.0 - confusion) * _density(at, up_to, mean[k], sigma[k]) + confusion * foreign
        own[k] = math.log((right + _FLOOR) / other)
        background[k] = math.log((false + _FLOOR) / other)


@njit(cache=True)
def _density(at, up_to, mean, sigma):
    """Of a Gaussian cut off at 0 and 1 (with mean 0: a half-normal); its mean from 0 to up_to where `at` is NaN."""
    below = _below((0.0 - mean) / sigma)
    inside = _below((1.0 - mean) / sigma) - below
    if math.isnan(at):
        return (_below((up_to - mean) / sigma) - below) / (inside * up_to)
    z = (at - mean) / sigma
    return math.exp(-0.5 * z * z) / (math.sqrt(2.0 * math.pi) * sigma * inside)


@njit(cache=True)
def _below(z):
    """Standard normal distribution function."""
    return 0.5 * math.erfc(-z / math.sqrt(2.0))
