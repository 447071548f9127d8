"""Whether a thing is still there.

What a landmark's views said about whether it *is an object* adds up for ever; that it has been taken away shows only
in the looks since. With a log ratio l_t of "gone" over "there" for each look, the most likely time of the change is

    G_t = max(G_{t-1}, log hazard) + l_t,      P(still there) = 1 / (1 + exp(G_t))

(Page's cumulative sum, 1954, with the prior of a change paid once). Looks that say nothing, of hidden things above all,
change nothing: what is not looked at is not forgotten.

A look is compared with what is usual: the free share of the volume in looks that detected the thing, or from the same
direction before. A chair has gaps, and what a badly placed volume shows from one side it shows for ever.
"""

from __future__ import annotations

import math

import numpy as np

from ...factors.free_space import FreeSpace
from ..config import PresenceConfig

USUAL_LOOKS = 2.0  # looks that the free share expected of any object counts as


class Presence:
    """The evidence that one thing has been taken away."""

    def __init__(self, config: PresenceConfig, free_space: FreeSpace) -> None:
        self._config, self._free_space = config, free_space
        self._gone = math.log(config.hazard)
        self._free, self._looks = USUAL_LOOKS * config.usual_free, USUAL_LOOKS
        self._usual_from: dict[int, float] = {}  # cell -> free share that is usual from there

    @property
    def probability(self) -> float:
        """P(it is still where it was)."""
        return 1.0 / (1.0 + math.exp(min(self._gone, 700.0)))

    def look(self, cell: int, weight: float, free: float, seen: float, detected: bool) -> None:
        """One look.

        Args:
            cell: direction of the look (`ViewCells.find`), and
            weight: how new that direction was.
            free: share of the volume that is free, of what is not hidden.
            seen: share of the volume that depth tells of: not hidden, in the image, with readings.
            detected: whether the detector found it.
        """
        usual = self._usual_from.get(cell)
        if detected:
            self._free += free
            self._looks += 1.0
            self._usual_from[cell] = free if usual is None else max(usual, free)
            self._add(-self._config.detected)
            return
        own = self._free / self._looks
        ratio = self._removed(free, own)
        if usual is None:
            # what is there fills most of its volume from wherever: a first look at an empty place is not usual
            self._usual_from[cell] = min(free, max(self._config.usual_most, own))
            ratio *= weight
        elif ratio > 0.0:
            # more than what is usual of the thing, but news only if it is more than what is usual from here
            ratio = max(self._removed(free, max(own, usual)), 0.0)
        self._add(seen * ratio)

    def absorb(self, other: Presence) -> None:
        """The landmark was merged with another: it is there if either is."""
        self._gone = min(self._gone, other._gone)
        self._free += other._free - USUAL_LOOKS * self._config.usual_free
        self._looks += other._looks - USUAL_LOOKS
        self.forget_places()

    def forget_places(self) -> None:
        """The numbers of the cells are no longer the same."""
        self._usual_from.clear()

    def _removed(self, free: float, usual: float) -> float:
        return float(self._free_space.removed(np.array([free]), np.array([usual]))[0])

    def _add(self, log_ratio: float) -> None:
        self._gone = max(self._gone, math.log(self._config.hazard)) + log_ratio
