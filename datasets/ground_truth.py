"""Everything that is known about a scene, whoever knows it: what maps are judged by."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from .frame import Intrinsics
from .sequence import Sequence
from .truth import FrameTruth, PointTruth, TrueObject


@dataclass(frozen=True, slots=True, eq=False)
class GroundTruth:
    """Truth of a sequence; what a source does not tell is None or empty.

    Attributes:
        name: for people.
        classes: every class that is annotated.
        objects: annotated objects; position or size NaN where unknown (boxes in images only).
        tolerance: object id -> metres, how well its position is known; absent where exactly.
        complete: every object of `classes` in the scene is annotated, so that anything else is a false positive.
        false_detections: things that detectors take for objects, by class and position; never in `objects`.
        up: (3,) unit vector in world axes, None where unknown.
        intrinsics: of all frames, or None.
        names: names of the frames, in order.
        stamps: (N,) seconds of the frames.
        poses: (N, 4, 4) `T_world_camera`, NaN where a frame has none; None without.
        frame_truth: what can be seen in the frame with this index; None without 2D annotation. An index without
            annotation gives None.
        point_truth: the labelled cloud; None without.
        sequence: the images, None where they are not at hand.
    """

    name: str
    classes: tuple[str, ...]
    objects: tuple[TrueObject, ...] = ()
    tolerance: Mapping[int, float] = field(default_factory=dict)
    complete: bool = True
    false_detections: tuple[TrueObject, ...] = ()
    up: np.ndarray | None = None
    intrinsics: Intrinsics | None = None
    names: tuple[str, ...] = ()
    stamps: np.ndarray = field(default_factory=lambda: np.empty(0))
    poses: np.ndarray | None = None
    frame_truth: Callable[[int], FrameTruth | None] | None = None
    point_truth: Callable[[], PointTruth] | None = None
    sequence: Sequence | None = None

    @property
    def located(self) -> tuple[TrueObject, ...]:
        """Objects whose position is known."""
        return tuple(thing for thing in self.objects if np.all(np.isfinite(thing.position)))
