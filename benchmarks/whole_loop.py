"""The whole loop on a recorded sequence: its pace and stages, and memory against frames in a space already explored."""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from laps import BackAndForth
from memory import MapperSizes, measure_mapper
from results import table

from thingmap.datasets.errors import UserError
from thingmap.datasets.open import open_sequence
from thingmap.datasets.sequence import Sequence
from thingmap.datasets.views import subset, usable_frames
from thingmap.detectors.detector import Detector
from thingmap.detectors.recorded import write_detections
from thingmap.detectors.spec import make_detector
from thingmap.mapper.mapper import SemanticMapper
from thingmap.mapper.run_report import RunReport
from thingmap.mapper.runner import Progress, run_sequence

SENSOR_HZ = 30.0
WARM_UP_FRAMES = 90  # enough for landmarks, and so for every compiled kernel
SAMPLE_EVERY = 100  # frames between two looks at memory


@dataclass(frozen=True, slots=True)
class LoopResult:
    """One pass.

    Attributes:
        report: of the run.
        seconds: from opening the sequence to the last frame.
        warm_up: seconds of the pass before over the first `WARM_UP_FRAMES`, which compiles kernels or loads them.
        warm_up_frames: how many these were.
        statistics: the mapper's.
    """

    report: RunReport
    seconds: float
    warm_up: float
    warm_up_frames: int
    statistics: dict[str, Any]


def record(sequence: Sequence, spec: str, path: Path) -> float:
    """Run a detector over a sequence into a file; returns milliseconds a frame."""
    detector, times = make_detector(spec, sequence), []

    def detections():
        for frame in usable_frames(sequence, lambda broken: None):
            start = time.perf_counter()
            found = detector(frame)
            times.append(time.perf_counter() - start)
            yield frame.name, found

    items = detections()
    first = next(items, None)
    if first is None:
        raise UserError(f"{sequence.name}: none of the {len(sequence)} frames can be used")
    write_detections(path, first[1].classes, (item for group in ([first], items) for item in group))
    return 1e3 * float(np.median(times))


def run_loop(path: Path, detector_spec: str, max_frames: int | None) -> LoopResult:
    """Map the sequence once as `thingmap run` does, after a warm-up on its first frames."""
    start = time.perf_counter()
    few = subset(open_sequence(path), max_frames=min(WARM_UP_FRAMES, max_frames or WARM_UP_FRAMES))
    mapper = _mapper(few, make_detector(detector_spec, few))
    run_sequence(few, mapper)
    mapper.object_map()
    warm_up = time.perf_counter() - start

    start = time.perf_counter()
    sequence = open_sequence(path, max_frames=max_frames)
    mapper = _mapper(sequence, make_detector(detector_spec, sequence))
    report = run_sequence(sequence, mapper)
    seconds = time.perf_counter() - start
    return LoopResult(report, seconds, warm_up, len(few), mapper.statistics())


def describe_loop(result: LoopResult, detector_ms: float | None) -> str:
    """Pace and stages, in words and a table."""
    report, pace = result.report, result.report.frames_used / result.seconds
    steady = result.warm_up_frames / pace
    lines = [
        f"`{report.source}`: {report.frames_used} frames ({report.frames_skipped} skipped), {report.keyframes} "
        f"keyframes, recorded detections. **{pace / SENSOR_HZ:.2f} x the sensor's {SENSOR_HZ:.0f} Hz** from opening "
        f"the sequence to its last frame, reading ahead ({pace:.1f} frames/s in this one run).",
        f"Warm-up, not counted: {result.warm_up:.1f} s for {result.warm_up_frames} frames, of which about "
        f"{max(result.warm_up - steady, 0.0):.1f} s are numba compiling its kernels or loading them from its cache.",
        f"Peak memory of the process: {report.peak_memory_mb or float('nan'):.0f} MB.",
    ]
    if detector_ms is not None:
        lines.append(f"The detector, recorded beforehand, took {detector_ms:.0f} ms a frame (median).")
    return "\n".join(lines) + "\n\n" + _stage_table(result)


def _stage_table(result: LoopResult) -> str:
    report, rows = result.report, []
    for name, stage in report.stages.items():  # every frame is read, the usable ones are mapped
        count = report.frames_used + (report.frames_skipped if name == "reading" else 0)
        rows.append([f"{name} (every frame)", count, stage.median_ms, stage.p95_ms, stage.total_ms / 1e3])
    rows += [
        [f"- {name}", stage["count"], stage["median_ms"], stage["p95_ms"], stage["total_s"]]
        for name, stage in result.statistics["stages"].items()
    ]
    shown = [
        [name, count, f"{median:.2f}", f"{p95:.2f}", f"{100.0 * total / result.seconds:.1f} %"]
        for name, count, median, p95, total in rows
    ]
    return table(["stage", "times", "median ms", "p95 ms", "share of the run"], shown)


@dataclass(frozen=True, slots=True)
class MemorySample:
    """A look at memory after so many frames."""

    frames: int
    sizes: MapperSizes


def run_laps(path: Path, detector_spec: str, max_frames: int | None, laps: int) -> list[MemorySample]:
    """Map the sequence to and fro; a sample every `SAMPLE_EVERY` frames and at the end of each lap."""
    sequence = open_sequence(path, max_frames=max_frames)
    mapper = _mapper(sequence, make_detector(detector_spec, sequence))
    round_trip = BackAndForth(sequence, laps)
    lap, samples = 2 * len(sequence), []

    def look(now: Progress) -> None:
        if now.done % SAMPLE_EVERY == 0 or now.done % lap == 0:
            samples.append(MemorySample(now.done, measure_mapper(mapper)))

    run_sequence(round_trip, mapper, on_update=look)
    return samples


def describe_laps(samples: list[MemorySample], laps: int) -> str:
    """Memory at every sample, and what every lap added."""
    lap = samples[-1].frames // laps
    counts = ["keyframes", "landmarks", "candidates", "cloud_points", "local_map_points", "ledger_records"]
    rows = [[s.frames, f"{s.sizes.total_mb:.0f}", *(getattr(s.sizes, name) for name in counts)] for s in samples]
    ends = [s.sizes for s in samples if s.frames % lap == 0]
    names = ["ledger", "cloud", "landmarks_and_tracks", "trajectory", "local_map", "graph_and_rest", "total"]
    growth = [
        [f"{i + 2}", *(f"{getattr(b, n + '_mb') - getattr(a, n + '_mb'):+.2f}" for n in names)]
        for i, (a, b) in enumerate(pairwise(ends))
    ]
    parts = [
        f"A lap is to the end of the sequence and back, {lap} frames; the local map is KISS-ICP's.",
        table(["frames", "resident MB", *_words(counts)], rows),
    ]
    if growth:
        parts += [
            "MB that a lap adds once the space is explored (the first lap does that); graph and rest is ISAM2 with "
            "its factors, and the allocator:",
            table(["lap", *_words(names)], growth),
        ]
    return "\n\n".join(parts)


def _words(names: list[str]) -> list[str]:
    return [name.replace("_", " ") for name in names]


def _mapper(sequence: Sequence, detector: Detector) -> SemanticMapper:
    return SemanticMapper(detector, source=sequence.name, gravity=sequence.gravity)
