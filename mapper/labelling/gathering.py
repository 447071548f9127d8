"""The loop over frames: what a detector says of each goes into the voxels."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from ...datasets.errors import UserError
from ...datasets.frame import BrokenFrame, Frame
from ...datasets.sequence import Sequence as Frames
from ...detectors.detections import Detections
from ...detectors.detector import Detector
from ...detectors.probability_maps import DenseDetector, ProbabilityMaps
from ..stages import StageClock
from .label_state import LabelState
from .labelling_config import LabellingConfig
from .mapped_frames import MappedFrames
from .sources import evidence_of
from .surface import surface_of


@dataclass(slots=True)
class Gathered:
    """What a pass came to: how many frames were `added`, problem -> names of those `skipped`, whether it `stopped`."""

    added: int = 0
    skipped: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    stopped: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Gatherer:
    """Adds frames to a state.

    Attributes:
        sequence: where they are.
        detector: what looks at them, with `detect_dense` where it has that.
        classes: K of the map, in whose order the evidence is kept.
        config: numbers.
        clock: takes the times of reading, detecting and integrating.
    """

    sequence: Frames
    detector: Detector
    classes: tuple[str, ...]
    config: LabellingConfig
    clock: StageClock

    def gather(
        self,
        state: LabelState,
        frames: MappedFrames,
        rows: Sequence[int] | np.ndarray,
        on_frame: Callable[[int, int], None],
        should_stop: Callable[[], bool],
    ) -> Gathered:
        """Add some rows of `frames` to `state`; `on_frame` is told how many of how many are done.

        Where `should_stop` says so it ends between two frames: the state holds those before.

        Raises:
            UserError: the detector finds classes that the map does not have.
        """
        result = Gathered()
        for done, row in enumerate(rows):
            if should_stop():
                result.stopped = True
                break
            self._add(state, frames, int(row), result)
            on_frame(done + 1, len(rows))
        return result

    def _add(self, state: LabelState, frames: MappedFrames, row: int, result: Gathered) -> None:
        try:
            with self.clock.stage("reading"):
                frame = self.sequence[int(frames.position[row])]
        except BrokenFrame as problem:
            result.skipped[problem.problem.value].append(problem.name)
            return
        with self.clock.stage("detecting"):
            detections, maps = self._detect(frame)
        check_classes(detections.classes, self.classes)
        with self.clock.stage("integrating"):
            sources = self.config.sources
            found = evidence_of(frame, detections, maps, self.config.voxels.pixel_step, sources)
            found = found.over(self.classes, sources.least)
            surface = surface_of(frame, found.uv)
            state.evidence.add(
                int(frames.anchor[row]),
                frames.T_keyframe_camera[row],
                surface.points,
                surface.normals,
                surface.colours,
                found.log_p,
                frames.T_world_keyframe,
            )
            state.note(frames, row)
        result.added += 1

    def _detect(self, frame: Frame) -> tuple[Detections, ProbabilityMaps | None]:
        if hasattr(self.detector, "detect_dense"):
            return cast(DenseDetector, self.detector).detect_dense(frame)
        return self.detector(frame), None


def check_classes(found: Sequence[str], classes: Sequence[str]) -> None:
    """Raises `UserError` where a detector's classes are not all among the map's; upper and lower case are the same."""
    known = {name.casefold() for name in classes}
    if strange := [name for name in found if name.casefold() not in known]:
        raise UserError(
            f"the detector finds {_some(strange)}, but the map's classes are {_some(classes)}; give a detector of "
            "those with --detector, or map again with this one"
        )


def _some(names: Sequence[str], most: int = 8) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
