"""What a mapper knows at this moment, for those who watch it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..detectors.detections import Detections
from .estimation.landmarks import Landmark


@dataclass(frozen=True, slots=True, eq=False)
class Glimpse:
    """A look at a mapper between two frames. Nothing was solved or settled for it, so watching changes no map.

    Attributes:
        T_world_keyframe: (M, 4, 4) of the keyframes, as estimated now.
        loops: (L, 2) int64, the keyframes that each loop closure of the graph connects, the earlier one first.
        R_world_upright: (3, 3) axes of the boxes; the last column points up.
        landmarks: in the graph now, probable or not. They are the mapper's own: read them before the next frame.
        candidates: things that are not yet in the graph.
        classes: K names; none before the first detections.
        detected: the frame's index and its detections, of the last frame whose detections were asked for.
        stages: name -> how often the stage was run, and the milliseconds of the last time.
    """

    T_world_keyframe: np.ndarray
    loops: np.ndarray
    R_world_upright: np.ndarray
    landmarks: tuple[Landmark, ...]
    candidates: int
    classes: tuple[str, ...]
    detected: tuple[int, Detections] | None
    stages: dict[str, tuple[int, float]]


class Watchable(Protocol):
    """A mapper that can be watched; all of this package can. None before its first frame."""

    def glimpse(self) -> Glimpse | None: ...
