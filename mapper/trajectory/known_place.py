"""Whether the camera knows where in its map it is."""

from __future__ import annotations

import numpy as np

from ..config import LoopConfig
from ..estimation.smoother import Smoother
from .rigid import inverse, tangent

KNOWN_SIGMA = (0.3, 0.3)  # rad, m: of a step; what is mapped after a worse one would be taken for other things
AGREEMENT = (0.05, 0.08)  # rad, m: between a loop and the estimate that it is part of; LoopConfig.agreement
WITNESSES = 2  # keyframes that recognise the old map, at poses which odometry ties together: one alone may be wrong


class KnownPlace:
    """Lost by a step that nothing measured, found again by links to what was seen before.

    While it is lost nothing is mapped. It is found once `WITNESSES` keyframes since the last unmeasured step have loops
    to keyframes from before it was lost, and all of them fit the estimate: places that look alike seldom agree on a
    motion. A camera that has been carried to where it has never been would wait for ever: after `patience` keyframes
    with measured steps its guessed pose is taken, to be corrected by whatever loop is closed later.
    """

    def __init__(self, config: LoopConfig) -> None:
        self._patience = config.patience
        self._smoother: Smoother | None = None
        self._anchor: int | None = None  # last keyframe before the place was lost
        self._landed = 0  # the first keyframe after the last unmeasured step
        self.lost = self.found = self.given_up = 0  # times

    def follow(self, smoother: Smoother) -> None:
        """Takes links from this smoother; without one no place is ever lost."""
        self._smoother = smoother

    @property
    def is_known(self) -> bool:
        """Whether the latest keyframe's place is."""
        return self._anchor is None

    def step(self, keyframe: int, covariance: np.ndarray) -> None:
        """A keyframe was added, (6, 6) from the one before; loops of those before it are solved."""
        if self._smoother is None:
            return
        if is_wide(covariance):
            self._landed = keyframe
            if self._anchor is None:
                self._anchor = keyframe - 1
                self.lost += 1
        elif self._anchor is None:
            return
        elif self._witnesses(self._smoother, self._anchor) >= WITNESSES:
            self._anchor = None
            self.found += 1
        elif keyframe - self._landed >= self._patience:
            self._anchor = None
            self.given_up += 1

    def _witnesses(self, smoother: Smoother, anchor: int) -> int:
        """Keyframes since the last unmeasured step that have loops to the old map which fit."""
        loops = [loop for loop in smoother.loops().values() if loop.a <= anchor and loop.b >= self._landed]
        if len(loops) < WITNESSES:
            return 0
        poses = smoother.poses()
        return len({loop.b for loop in loops if _fits(loop.T_a_b, inverse(poses[loop.a]) @ poses[loop.b])})


def _fits(T_measured: np.ndarray, T_estimated: np.ndarray) -> bool:
    """Of two (4, 4) motions."""
    off = tangent(T_measured, T_estimated)
    return bool(np.linalg.norm(off[:3]) < AGREEMENT[0] and np.linalg.norm(off[3:]) < AGREEMENT[1])


def is_wide(covariance: np.ndarray) -> bool:
    """Whether a (6, 6) covariance [rad, m] of a relative pose is that of a step, or a path, that nothing measured."""
    sigma = np.sqrt(np.diag(covariance))
    return bool(sigma[:3].max() > KNOWN_SIGMA[0] or sigma[3:].max() > KNOWN_SIGMA[1])
