"""Relative poses between neighbouring keyframes from image features and depth.

KISS-ICP slips along bare planes and counters; corners in the image hold those directions. Features of the new keyframe
are matched to those of the last few.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from ...config import VisualConfig
from .feature_motion import RelativePose, relative_pose
from .features import Features


@dataclass(frozen=True, slots=True, eq=False)
class VisualEdge:
    """Measured motion from the keyframe numbered `a` to a frame: `motion.T_a_b`."""

    a: int
    motion: RelativePose


class VisualOdometry:
    """Remembers the features of the last keyframes; measures the next one against them."""

    def __init__(self, config: VisualConfig, seed: int, most: int = 0) -> None:
        self._config, self._seed = config, seed
        self._recent: deque[tuple[int, Features]] = deque(maxlen=max(config.neighbours, most))

    def edges(self, features: Features, neighbours: int | None = None) -> list[VisualEdge]:
        """Motions from the last keyframes to a frame; fewer, or none, where too little matches.

        Args:
            features: of the frame.
            neighbours: keyframes back; None for the configured number.
        """
        count = self._config.neighbours if neighbours is None else neighbours
        edges = []
        for number, old in list(self._recent)[-count:]:
            motion = relative_pose(old, features, self._config, self._seed)
            if motion is not None:
                edges.append(VisualEdge(number, motion))
        return edges

    def remember(self, keyframe: int, features: Features) -> None:
        """The next frames are measured against this one."""
        self._recent.append((keyframe, features))
