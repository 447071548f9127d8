"""How likely a detector's score vector is, given the class and how much of the object was occluded.

Meger et al., Mobile 3D Object Detection in Clutter, sections III-D and IV: the score of the object's own class is
Gaussian with a mean that falls as occlusion grows, given in bins of width 0.1 with linear interpolation between
their centres; above an occlusion of 0.7 the detector is expected to respond as if no object were there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BIN_WIDTH = 0.1  # of the occlusion ratio (section IV)
TRUNCATION = 0.7  # occlusion above which the object counts as fully occluded (section IV)
_BINS = (np.arange(10) + 0.5) * BIN_WIDTH
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
    stay below 0.3. A model learned for the detector at hand replaces them.

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
        """Mean and standard deviation of the own-class score at this occlusion ratio, interpolated between bins."""
        means = self.mean_visible + (self.mean_occluded - self.mean_visible) * np.minimum(_BINS / TRUNCATION, 1.0)
        return float(np.interp(occlusion, _BINS, means)), self.sigma

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
        named = np.exp(-0.5 * ((s - mean) / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))
        return (1.0 - self.confusion) * named + self.confusion * _half_normal(s, self.other_sigma) + _FLOOR

    def _background(self, s: np.ndarray) -> np.ndarray:
        sigma = self.background_sigma
        return np.exp(-0.5 * ((s - self.background_mean) / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi)) + _FLOOR

    def _other(self, s: np.ndarray, classes: int) -> np.ndarray:
        named_by_mistake = self.confusion / max(classes - 1, 1)
        return (1.0 - named_by_mistake) * _half_normal(s, self.other_sigma) + named_by_mistake


def _half_normal(x: np.ndarray, sigma: float) -> np.ndarray:
    return np.exp(-0.5 * (x / sigma) ** 2) * np.sqrt(2.0 / np.pi) / sigma
