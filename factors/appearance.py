"""How likely a detector's score vector is, given the class and how much of the object was occluded.

Meger et al., Mobile 3D Object Detection in Clutter, sections III-D and IV: the score of the object's own class is
Gaussian with a mean that falls as occlusion grows; above an occlusion of 0.7 the detector is expected to respond as if
no object were there. The paper learns a Gaussian for every tenth of occlusion and interpolates; these defaults, which
know no detector in particular, are one line. Scores are bounded, so the Gaussians are cut off at 0 and 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

TRUNCATION = 0.7  # occlusion above which the object counts as fully occluded (section IV)
_GRID = np.linspace(0.0, 1.0, 101)  # scores, where a density is integrated
_FLOOR = 1e-6  # of a density, so that its logarithm stays finite


@dataclass(frozen=True, slots=True, eq=False)
class ScoreEvidence:
    """What one score vector says, nats, relative to a vector in which every class scores as a foreign class does.

    Attributes:
        own: (K,) for "the object is of class k".
        background: (K,) for "there is no object, but something that looks like class k".
    """

    own: np.ndarray
    background: np.ndarray


@dataclass(frozen=True, slots=True)
class AppearanceModel:
    """Densities of scores in [0, 1].

    The defaults are wide ones for detectors with sigmoid scores: a visible object of an indoor class scores about 0.5
    with YOLO-family detectors of 1 to 10 M parameters, and false boxes above a confidence threshold of 0.08 mostly
    stay below 0.3. The configuration overrides them (`evidence: appearance:`).

    Attributes:
        mean_visible, mean_occluded: own-class mean score at occlusion 0 and 0.7, linear between.
        sigma: own-class standard deviation.
        background_mean, background_sigma: top score of boxes that show no object.
        other_sigma: half-normal scale of the scores of classes that the object is not of.
        confusion: share of views in which the detector names another class than the object's, any of the others alike.
    """

    mean_visible: float = 0.52
    mean_occluded: float = 0.28
    sigma: float = 0.25
    background_mean: float = 0.12
    background_sigma: float = 0.16
    other_sigma: float = 0.05
    confusion: float = 0.15

    def own_parameters(self, occlusion: float) -> tuple[float, float]:
        """Mean and standard deviation of the own-class score at this occlusion ratio."""
        return float(np.interp(occlusion, [0.0, TRUNCATION], [self.mean_visible, self.mean_occluded])), self.sigma

    def evidence(self, scores: np.ndarray, occlusion: float) -> ScoreEvidence:
        """Evidence of one score vector.

            own_k = log own(s_k | occlusion) - log other(s_k)
            background_k = log background(s_k) - log other(s_k)

        Args:
            scores: (K,); NaN where the detector did not report a class (then it scored below the best one, and the
                densities are integrated up to there).
            occlusion: ratio of occluded pixels in [0, 1]. Above 0.7 the view says nothing (zeros).
        """
        if occlusion > TRUNCATION or np.all(np.isnan(scores)):
            return ScoreEvidence(np.zeros(len(scores)), np.zeros(len(scores)))
        mean, sigma = self.own_parameters(occlusion)
        s = np.clip(np.nan_to_num(scores), 0.0, 1.0)
        own, background, other = self._own(s, mean, sigma), self._background(s), self._other(s, len(s))
        unreported = np.isnan(scores)
        if unreported.any():
            below = _GRID[np.nanmax(scores) >= _GRID]
            own[unreported] = self._own(below, mean, sigma).mean()
            background[unreported] = self._background(below).mean()
            other[unreported] = self._other(below, len(s)).mean()
        return ScoreEvidence(np.log(own / other), np.log(background / other))

    def _own(self, s: np.ndarray, mean: float, sigma: float) -> np.ndarray:
        return (
            (1.0 - self.confusion) * _cut_normal(s, mean, sigma)
            + self.confusion * _half_normal(s, self.other_sigma)
            + _FLOOR
        )

    def _background(self, s: np.ndarray) -> np.ndarray:
        return _cut_normal(s, self.background_mean, self.background_sigma) + _FLOOR

    def _other(self, s: np.ndarray, classes: int) -> np.ndarray:
        named_by_mistake = self.confusion / max(classes - 1, 1)
        return (1.0 - named_by_mistake) * _half_normal(s, self.other_sigma) + named_by_mistake


def _cut_normal(x: np.ndarray, mean: float, sigma: float) -> np.ndarray:
    """Density of a Gaussian on [0, 1]."""
    inside = ndtr((1.0 - mean) / sigma) - ndtr(-mean / sigma)
    return np.exp(-0.5 * ((x - mean) / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi) * inside)


def _half_normal(x: np.ndarray, sigma: float) -> np.ndarray:
    return np.exp(-0.5 * (x / sigma) ** 2) * np.sqrt(2.0 / np.pi) / sigma
