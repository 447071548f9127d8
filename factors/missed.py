"""Evidence from being seen and from being missed where it should have been seen.

How readily a detector finds one particular object is a property of that object (its texture, its pose, its likeness
to the training images), so misses of one object are not independent. Its detection rate r when fully visible is
therefore a latent variable with a Beta prior, wide for objects and low for things that are none, and is integrated
out:

    log p(h, m | object) - log p(h, m | none)
        = log B(a + h, b + m) / B(a, b) - log B(a0 + h, b0 + m) / B(a0, b0)

with h the (weighted) views in which it was detected and m those in which it was missed though it should have been
seen. Independent misses, log(1 - P_D) added up, are the limit of a narrow prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import betaln


@dataclass(frozen=True, slots=True)
class DetectionRate:
    """Beta priors of the detection rate, and how it falls with visibility and size.

    Attributes:
        object_prior: (a, b) for objects; mean 0.67, four fifths of the mass above 0.5.
        none_prior: (a, b) for things that are no object; mean 0.17: false boxes come and go between views.
        min_visible: visible share below which a detector is not expected to respond (0.3; Meger et al., Clutter, IV).
        min_pixels: px; side of the projected box below which detectors respond unreliably.
    """

    object_prior: tuple[float, float] = (4.0, 2.0)
    none_prior: tuple[float, float] = (1.0, 5.0)
    min_visible: float = 0.3
    min_pixels: float = 16.0

    def expected(self, visible: np.ndarray, side_px: np.ndarray) -> np.ndarray:
        """Factor in [0, 1] on the detection rate.

        Args:
            visible: (N,) share of the object that is inside the image and not occluded.
            side_px: (N,) geometric mean of the projected box's sides, pixels.
        """
        seen = np.clip((visible - self.min_visible) / (0.8 - self.min_visible), 0.0, 1.0)
        return seen * np.clip(side_px / self.min_pixels - 0.5, 0.0, 1.0)

    def log_ratio(self, hits: float, misses: float) -> float:
        """Evidence for being an object, nats; `hits` and `misses` are sums of view weights."""
        return float(_log_marginal(self.object_prior, hits, misses) - _log_marginal(self.none_prior, hits, misses))


def _log_marginal(prior: tuple[float, float], hits: float, misses: float) -> np.floating:
    a, b = prior
    return betaln(a + hits, b + misses) - betaln(a, b)
