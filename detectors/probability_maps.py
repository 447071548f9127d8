"""For every pixel the probability of every class, and of none (Lai et al. 2012, III-A)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..datasets.frame import Frame
from .checks import checked_classes
from .detections import Detections

ALPHA = 0.1  # of eq. (5), as in the paper's experiments (IV-A)


@dataclass(frozen=True, slots=True, eq=False)
class ProbabilityMaps:
    """What a detector makes of each pixel of an image.

    The columns of a pixel do not sum to one: each class is told from everything else by itself.

    Attributes:
        classes: K names.
        probabilities: (K, H, W) float32, p(class | pixel), strictly between 0 and 1: labelling takes its logarithm.
        background: (H, W) float32, p(no class | pixel).

    Raises:
        ValueError: for other shapes.
    """

    classes: tuple[str, ...]
    probabilities: np.ndarray
    background: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "classes", checked_classes(self.classes))
        shape = np.shape(self.probabilities)
        if len(shape) != 3 or shape[0] != len(self.classes):
            raise ValueError(f"probabilities must have shape ({len(self.classes)}, H, W), but got shape {shape}")
        if np.shape(self.background) != shape[1:]:
            raise ValueError(f"background must have shape {shape[1:]}, but got shape {np.shape(self.background)}")

    @classmethod
    def of(cls, classes: Sequence[str], probabilities: np.ndarray, alpha: float = ALPHA) -> ProbabilityMaps:
        """With the background of eq. (5), alpha min_c (1 - p(c | pixel)); alpha where there are no classes.

        1 - p of any class is an upper bound of the background's probability (eq. 4), and alpha says how loose it is.
        """
        most = probabilities.max(axis=0, initial=0.0)
        return cls(tuple(classes), probabilities, np.float32(alpha) * (np.float32(1.0) - most))


class DenseDetector(Protocol):
    """A detector that also gives probability maps."""

    def __call__(self, frame: Frame, /) -> Detections: ...

    def detect_dense(self, frame: Frame, /) -> tuple[Detections, ProbabilityMaps]:
        """Detections of a frame, the same as of a call, and its maps."""
        ...
