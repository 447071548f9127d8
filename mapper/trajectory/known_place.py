"""Whether the camera knows where in its map it is."""

from __future__ import annotations

import numpy as np

from ..config import LoopConfig
from ..estimation.smoother import Smoother

KNOWN_SIGMA = (0.3, 0.3)  # rad, m: of a step; what is mapped after a worse one would be taken for other things


class KnownPlace:
    """Lost by a step that nothing measured, found again by a link to what was seen before.

    While it is lost nothing is mapped. A camera that has been carried to where it has never been would wait for ever:
    after `patience` keyframes its guessed pose is taken, to be corrected by whatever loop is closed later.
    """

    def __init__(self, config: LoopConfig) -> None:
        self._patience = config.patience
        self._smoother: Smoother | None = None
        self._anchor: int | None = None  # last keyframe before the place was lost
        self.lost = self.found = self.given_up = 0  # times

    def follow(self, smoother: Smoother) -> None:
        """Takes links from this smoother; without one no place is ever lost."""
        self._smoother = smoother

    @property
    def is_known(self) -> bool:
        """Whether the latest keyframe's place is."""
        return self._anchor is None

    def step(self, keyframe: int, covariance: np.ndarray) -> None:
        """A keyframe was added, (6, 6) from the one before."""
        if self._smoother is None:
            return
        if self._anchor is None:
            if _is_wide(covariance):
                self._anchor = keyframe - 1
                self.lost += 1
            return
        if not _is_wide(self._smoother.path_covariances(keyframe - 1)[self._anchor]):
            self._anchor = None
            self.found += 1
        elif keyframe - self._anchor > self._patience:
            self._anchor = None
            self.given_up += 1


def _is_wide(covariance: np.ndarray) -> bool:
    """Of a (6, 6) covariance [rad, m] of a relative pose."""
    sigma = np.sqrt(np.diag(covariance))
    return bool(sigma[:3].max() > KNOWN_SIGMA[0] or sigma[3:].max() > KNOWN_SIGMA[1])
