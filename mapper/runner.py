"""A whole sequence through the mapper."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..datasets.errors import UserError
from ..datasets.frame import BrokenFrame, Frame
from ..datasets.sequence import Sequence
from ..detectors.detections import Detections
from .map.object_map import ObjectMap
from .read_ahead import ReadAhead, Reading
from .run_report import RunReport, StageTime, peak_memory_mb


class Update(Protocol):
    """What the loop needs of the mapper's answer to a frame."""

    @property
    def is_keyframe(self) -> bool: ...
    @property
    def T_world_camera(self) -> np.ndarray: ...
    @property
    def things(self) -> int: ...


class Mapper(Protocol):
    """What a run needs of a mapper; `SemanticMapper` is one.

    `process_frame` may raise `BrokenFrame`, after which the mapper is as before. `trajectory` gives (N,) stamps in
    seconds and (N, 4, 4) `T_world_camera` of every processed frame; `keyframes` the same of keyframes with (M, 6, 6)
    covariances; `cloud` (M, 3) metres and (M, 3) uint8 RGB.
    """

    def process_frame(self, frame: Frame, detections: Detections | None = None) -> Update: ...
    def object_map(self, include_doubtful: bool = False) -> ObjectMap: ...
    def trajectory(self) -> tuple[np.ndarray, np.ndarray]: ...
    def keyframes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...
    def cloud(self) -> tuple[np.ndarray, np.ndarray]: ...
    def statistics(self) -> dict[str, Any]: ...
    def save_ledger(self, path: Path) -> None: ...


@dataclass(frozen=True, slots=True, eq=False)
class Progress:
    """Where the run is: `done` of `total` frames, `skipped` among them.

    `update` is what the mapper said of the `frame` at hand; both are None for a skipped one.
    """

    done: int
    total: int
    skipped: int
    things: int
    update: Update | None
    frame: Frame | None = None


class SequenceRun:
    """One pass over a sequence; `report` may be asked for at any time, also after an exception."""

    def __init__(
        self,
        sequence: Sequence,
        mapper: Mapper,
        on_update: Callable[[Progress], None] | None = None,
        should_stop: Callable[[], bool] | None = None,
    ) -> None:
        self._sequence, self._mapper = sequence, mapper
        self._on_update, self._should_stop = on_update, should_stop
        self._used = self._keyframes = self._things = self._position = 0
        self._skipped: dict[str, list[str]] = defaultdict(list)
        self._times: dict[str, list[float]] = {"reading": [], "mapping": []}
        self._stopped: str | None = None
        self._seconds = 0.0

    def execute(self) -> RunReport:
        """Map every frame in order, skipping those that cannot be used.

        `KeyboardInterrupt`, and `should_stop` between two frames, end the run; the report says where.

        Raises:
            UserError: no frame of the sequence could be used.
            Exception: whatever the sequence or the mapper raised; what was mapped before stays in the mapper.
        """
        start = time.perf_counter()
        try:
            with ReadAhead(self._sequence) as readings:
                self._loop(readings)
        except KeyboardInterrupt:
            self._stopped = f"interrupted at frame {self._position}"
        except Exception as error:
            self._stopped = f"{type(error).__name__} at frame {self._position}: {error}"
            raise
        finally:
            self._seconds = time.perf_counter() - start
        if self._used == 0 and self._stopped is None:
            raise UserError(self._why_nothing())
        return self.report

    @property
    def report(self) -> RunReport:
        """The account so far."""
        return RunReport(
            source=self._sequence.name,
            frames_total=len(self._sequence),
            frames_used=self._used,
            keyframes=self._keyframes,
            things=self._things,
            skipped={problem: tuple(names) for problem, names in self._skipped.items()},
            stopped=self._stopped,
            seconds=self._seconds,
            stages={stage: StageTime.of(times) for stage, times in self._times.items()},
            peak_memory_mb=peak_memory_mb(),
        )

    def _loop(self, readings: ReadAhead) -> None:
        asked = time.perf_counter()
        for reading in readings:
            received = time.perf_counter()
            self._times["reading"].append(1e3 * (received - asked))
            self._position = reading.position
            if self._should_stop is not None and self._should_stop():
                raise KeyboardInterrupt
            update = self._take(reading)
            if self._on_update is not None:
                skipped = sum(len(names) for names in self._skipped.values())
                done, total = reading.position + 1, len(self._sequence)
                frame = reading.result if update is not None and isinstance(reading.result, Frame) else None
                self._on_update(Progress(done, total, skipped, self._things, update, frame))
            self._position = reading.position + 1
            asked = time.perf_counter()

    def _take(self, reading: Reading) -> Update | None:
        """Map one frame; None where it cannot be used, be it the sequence or the mapper that finds so."""
        if isinstance(reading.result, BrokenFrame):
            self._skip(reading.result)
            return None
        start = time.perf_counter()
        try:
            update = self._mapper.process_frame(reading.result)
        except BrokenFrame as problem:
            self._skip(problem)
            return None
        self._times["mapping"].append(1e3 * (time.perf_counter() - start))
        self._used += 1
        self._keyframes += bool(update.is_keyframe)
        self._things = int(update.things)
        return update

    def _skip(self, problem: BrokenFrame) -> None:
        name = problem.name + (f" ({problem.detail})" if problem.detail else "")
        self._skipped[problem.problem.value].append(name)

    def _why_nothing(self) -> str:
        total = len(self._sequence)
        if total == 0:
            return f"{self._sequence.name}: the sequence has no frames; check its folder, --stride and --max-frames"
        counts = ", ".join(f"{len(names)} with {problem}" for problem, names in self._skipped.items())
        first = next(iter(self._skipped.values()))[0]
        return f"{self._sequence.name}: none of the {total} frames can be used: {counts}, the first being {first}"


def run_sequence(
    sequence: Sequence, mapper: Mapper, *, on_update: Callable[[Progress], None] | None = None
) -> RunReport:
    """Map a whole sequence; as `SequenceRun.execute`."""
    return SequenceRun(sequence, mapper, on_update).execute()
