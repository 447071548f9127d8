"""What the live view costs: the whole loop with and without a recording, taking turns frame by frame.

uv run python benchmarks/live_view.py                                          the rendered table-top
uv run python benchmarks/live_view.py --sequence DIR --detections FILE         a recorded sequence

Two mappers map the same frames in one pass, one of them watched by a live view that records to a file; what else runs
on the machine slows both alike. The milliseconds are those of logging; rerun writes the file in threads of its own,
which the ratio of the two loops has in it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence as Arguments
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from results import show_section, table

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import BrokenFrame
from thingmap.datasets.open import open_sequence
from thingmap.datasets.sequence import Sequence
from thingmap.detectors.spec import make_detector
from thingmap.mapper.mapper import SemanticMapper
from thingmap.mapper.runner import Progress
from thingmap.mapper.view.live import LiveView
from thingmap.mapper.view.live_targets import LiveTargets

WARM_UP = 30  # frames, not counted: kernels are compiled and loaded, rerun's first calls import its parts
SAMPLE = "sample:tabletop"


@dataclass(frozen=True, slots=True, eq=False)
class LiveCost:
    """Milliseconds of each frame after the warm-up, and the size of the recording.

    Attributes:
        alone: (N,) of the mapper that nobody watches.
        watched: (N,) of the other one, without
        view: (N,) of the live view.
        keyframe: (N,) bool.
        megabytes: of the file, with the warm-up's frames.
        frames: in the file.
    """

    alone: np.ndarray
    watched: np.ndarray
    view: np.ndarray
    keyframe: np.ndarray
    megabytes: float
    frames: int

    @property
    def ratio(self) -> float:
        """Of the whole loop with the view to that without."""
        return float((self.watched.sum() + self.view.sum()) / self.alone.sum())


def measure(sequence: Sequence, spec: str, file: Path, warm_up: int = WARM_UP) -> LiveCost:
    """Map a sequence twice at once, into `file` too; raises `UserError` where nothing is left after the warm-up."""
    mappers = [SemanticMapper(make_detector(spec, sequence), source=sequence.name) for _ in range(2)]
    failures: list[str] = []
    recording = LiveTargets(file=file, overwrite=True).open(sequence.name)
    view = LiveView(mappers[1], recording, mappers[1].config.cloud, failures.append)
    rows: list[tuple[float, float, float, bool]] = []
    for position in range(len(sequence)):
        try:
            frame = sequence[position]
        except BrokenFrame:
            continue
        ticks = [0.0, 0.0]
        update = None
        for turn in (0, 1) if position % 2 else (1, 0):  # neither always finds the caches warm
            start = time.perf_counter()
            update = mappers[turn].process_frame(frame)
            ticks[turn] = time.perf_counter() - start
        start = time.perf_counter()
        view(Progress(position + 1, len(sequence), 0, 0, update, frame))
        assert update is not None
        rows.append((*ticks, time.perf_counter() - start, update.is_keyframe))
    view.close()
    if failures:
        raise UserError(failures[0])
    if len(rows) <= warm_up:
        raise UserError(f"{sequence.name}: expected more than {warm_up} frames, found {len(rows)}; take a longer one")
    alone, watched, seen, keyframe = np.array(rows)[warm_up:].T
    size = file.stat().st_size / 1e6
    return LiveCost(1e3 * alone, 1e3 * watched, 1e3 * seen, keyframe.astype(bool), size, len(rows))


def describe(cost: LiveCost, source: str) -> str:
    """What was measured, in words and a table."""
    kinds = {"all frames": np.ones(len(cost.view), dtype=bool), "keyframes": cost.keyframe, "others": ~cost.keyframe}
    rows = [
        [
            name,
            int(which.sum()),
            *(f"{np.median(x[which]):.2f}" for x in (cost.alone, cost.view)),
            _p95(cost.view, which),
        ]
        for name, which in kinds.items()
        if which.any()
    ]
    return (
        f"`{source}`, {len(cost.view)} frames after a warm-up, two mappers in turns, one recorded as with `--save`: "
        f"**the loop takes {cost.ratio:.3f} times as long** ({cost.view.mean():.2f} ms a frame for the view itself, "
        f"{cost.megabytes / cost.frames * 1e3:.0f} kB a frame in the file).\n\n"
        + table(["", "frames", "mapping, median ms", "live view, median ms", "live view, p95 ms"], rows)
    )


def main(arguments: Arguments[str] | None = None) -> int:
    """Measure, print, and write if asked to; 2 for a user's mistake."""
    options = _options(arguments)
    try:
        sequence = open_sequence(options.sequence, max_frames=options.max_frames)
        spec = f"recorded:{options.detections}" if options.detections else options.detector
        with tempfile.TemporaryDirectory() as folder:
            cost = measure(sequence, spec, Path(folder) / "run.rrd", options.warm_up)
        show_section("Live view", describe(cost, sequence.name), options.write)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def _p95(values: np.ndarray, which: np.ndarray) -> str:
    return f"{np.percentile(values[which], 95):.2f}"


def _options(arguments: Arguments[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--sequence", default=SAMPLE, metavar="SEQUENCE", help=f"what to map (default {SAMPLE})")
    add("--detections", type=Path, metavar="FILE", help="recorded detections of it")
    add("--detector", default="simulated", metavar="SPEC", help="without them (default simulated)")
    add("--max-frames", type=int, metavar="N", help="take only the first N frames")
    add("--warm-up", type=int, default=WARM_UP, metavar="N", help=f"frames not counted (default {WARM_UP})")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
