"""P_D: how likely a detector finds an object, given its class, how much of it shows, and how large it appears.

Neither paper models this: Meger et al. (Clutter, VI-C) let a missed detection count against an object only as far as
it is visible. Here that share is learned, for each template, as a logistic regression,

    logit P_D = intercept[class] + f(visible share) + g(log2 side in pixels)

with f and g piecewise linear between fixed knots and constant beyond them. A miss is evidence against existence as far
as the object should have been seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from .learned_numbers import TEMPLATES, checked_array, rows_of
from .score_model import TRUNCATION

VISIBLE_KNOTS = np.array([0.0, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0])  # share of the template's pixels that shows
LOG2_SIDE_KNOTS = np.arange(2.0, 10.0)  # log2 px: 4 to 512 px
LOGIT = (-50.0, 50.0)  # of a probability that is 0 or 1 to all digits but is finite


@dataclass(frozen=True, slots=True, eq=False)
class DetectionModel:
    """Additive logit of P_D; rows 0 to K - 1 of the intercept are `classes`, row K is pooled over all classes.

    Attributes:
        classes: K names.
        intercept: (K + 1, 5) by class and template (`VolumePart`).
        visible: (5, 7) at the `VISIBLE_KNOTS`.
        side: (5, 8) at the `LOG2_SIDE_KNOTS`.

    Raises:
        ValueError: an array is of another shape, or a number is out of its limits.
    """

    classes: tuple[str, ...]
    intercept: np.ndarray
    visible: np.ndarray
    side: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "classes", tuple(self.classes))
        shapes = {
            "intercept": (len(self.classes) + 1, TEMPLATES),
            "visible": (TEMPLATES, len(VISIBLE_KNOTS)),
            "side": (TEMPLATES, len(LOG2_SIDE_KNOTS)),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, checked_array(name, getattr(self, name), shape, LOGIT))

    def bind(self, classes: Sequence[str]) -> DetectionModel:
        """The model of a detector's classes, in its order; the pooled row for those that were not learned.

        Names compare without case, `_` and `-`.
        """
        return replace(self, classes=tuple(classes), intercept=self.intercept[rows_of(self.classes, classes)])

    def probability(
        self,
        visible: np.ndarray | float,
        side_px: np.ndarray | float,
        part: int = 0,
        posterior: np.ndarray | None = None,
    ) -> np.ndarray:
        """P_D of N objects.

        Args:
            visible: (N,) share of the template's pixels that is in the image and not occluded.
            side_px: (N,) geometric mean of the sides of the whole object's projected box, pixels.
            part: template.
            posterior: (N, K) class probabilities of each object, given that it is one; scaled to sum 1. Without it,
                and for an object whose probabilities are all zero, the pooled class.

        Returns:
            (N,) in [0, 1], the mean over the posterior. Arguments broadcast.
        """
        log2_side = np.log2(np.maximum(side_px, 1.0))
        logit = np.interp(visible, VISIBLE_KNOTS, self.visible[part])
        logit = logit + np.interp(log2_side, LOG2_SIDE_KNOTS, self.side[part])
        return self._mixed(logit, part, posterior)

    def relative(
        self,
        visible: np.ndarray | float,
        side_px: np.ndarray | float,
        part: int = 0,
        posterior: np.ndarray | None = None,
    ) -> np.ndarray:
        """(N,) P_D over the largest that it can be for these objects, in [0, 1]: what a miss counts.

        Zero where less than 0.3 is visible: there the detector responds "as if no object was present" (Clutter, IV),
        so that a thing that is hidden does not fade, however long. Arguments as for `probability`.
        """
        largest = self._mixed(self.visible[part].max() + self.side[part].max(), part, posterior)
        expected = self.probability(visible, side_px, part, posterior) / largest
        return np.where(1.0 - np.asarray(visible) > TRUNCATION, 0.0, expected)

    def _mixed(self, logit: np.ndarray | float, part: int, posterior: np.ndarray | None) -> np.ndarray:
        pooled = expit(self.intercept[-1, part] + logit)
        if posterior is None:
            return pooled
        by_class = expit(self.intercept[:-1, part] + np.asarray(logit)[..., None])
        total = np.sum(posterior, axis=-1)
        mean = np.sum(posterior * by_class, axis=-1)
        known = np.broadcast_to(total > 0.0, mean.shape)
        return np.where(known, mean / np.where(known, total, 1.0), pooled)
