"""Motion between neighbouring keyframes from whole images, where the geometry of what they show leaves it open."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ....datasets.frame import Frame
from ...config import HybridConfig, MapperConfig
from ...deferred import Deferred
from ...estimation.records import Visual
from ...estimation.smoother import Smoother
from ..rgbd_view import RgbdView
from .feature_motion import RelativePose
from .hybrid import HybridUnavailable, hybrid_motion


@dataclass(frozen=True, slots=True, eq=False)
class HybridJob:
    """Keyframes numbered `a` and `b`, and (4, 4) `T_a_b` to start at."""

    a: int
    b: int
    view_a: RgbdView
    view_b: RgbdView
    T_guess: np.ndarray
    config: HybridConfig


@dataclass(frozen=True, slots=True, eq=False)
class HybridFound:
    """What came of a job: a motion, or None and, where nothing could be tried, why."""

    a: int
    b: int
    motion: RelativePose | None
    unavailable: str = ""


def find_hybrid(job: HybridJob) -> HybridFound:
    """`hybrid_motion` as a job for another process."""
    try:
        motion = hybrid_motion(job.view_a, job.view_b, job.T_guess, job.config)
    except HybridUnavailable as problem:
        return HybridFound(job.a, job.b, None, str(problem))
    return HybridFound(job.a, job.b, motion)


class HybridLinks:
    """Has degenerate keyframes measured against the one before; results enter the graph a fixed number later.

    Args:
        config: of the whole mapper.
        smoother: whose keyframes are linked.
    """

    def __init__(self, config: MapperConfig, smoother: Smoother) -> None:
        self._config, self._smoother = config.hybrid, smoother
        self._jobs = Deferred(find_hybrid, config.loops.lag, config.loops.process)
        self._last: tuple[int, RgbdView] | None = None
        self.unavailable = ""  # why nothing is measured here, if so
        self.outcomes: Counter[str] = Counter()

    def add_keyframe(self, keyframe: int, frame: Frame, T_last_now: np.ndarray | None, degenerate: bool) -> None:
        """Remembers a keyframe; a degenerate one is measured against the last, which is (4, 4) `T_last_now` away."""
        view = RgbdView.of(frame)
        if degenerate and self._last is not None and T_last_now is not None and not self.unavailable:
            number, last = self._last
            self._jobs.submit(keyframe, HybridJob(number, keyframe, last, view, T_last_now, self._config))
        self._last = keyframe, view

    def collect(self, keyframe: int) -> None:
        """Puts what is due by this keyframe into the smoother, to be solved with it."""
        self._take(self._jobs.due(keyframe))

    def finish(self) -> None:
        """Puts all that is outstanding into the smoother."""
        self._take(self._jobs.drain())

    def _take(self, results: list[HybridFound]) -> None:
        for result in results:
            self.unavailable = self.unavailable or result.unavailable
            if result.motion is None:
                self.outcomes["whole image, unavailable" if result.unavailable else "whole image, none"] += 1
                continue
            self.outcomes["whole image"] += 1
            self._smoother.add(Visual(result.a, result.b, result.motion.T_a_b, result.motion.covariance))
