"""Trajectories: rendered and recorded sequences, the mapper with and without its parts, odometries alone.

uv run python benchmarks/trajectory.py --folder DIR --write                 ten rendered sequences of 200 to 1800 frames
uv run python benchmarks/trajectory.py --sequence DIR onnx:MODEL --write    recorded sequences too, with their detectors
uv run python benchmarks/trajectory.py --rows hand-held --seeds 1 --frames 90
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from results import show_section
from suite import FIRST_SEED
from trajectory_job import changed, map_sequence, open_one, render, run_all, scene_folder, track_sequence
from trajectory_measures import Measured, measure, open_surfaces
from trajectory_report import OWN_POSES, Results, Row, describe

from thingmap.datasets.errors import UserError
from thingmap.datasets.open import open_sequence
from thingmap.datasets.synthetic.config import Preset, SyntheticConfig
from thingmap.detectors.spec import make_detector
from thingmap.mapper.config import MapperConfig, OdometrySource

TITLE = "Trajectory"
TARGETS = {"redkitchen": 40.0}  # mm, of recorded sequences
NO_DETECTOR = "none"
WIDTH = 640  # pixels, of rendered images


@dataclass(frozen=True, slots=True)
class RenderedRow:
    """Rendered sequences of one kind: which, how many seeds, how long, and the error in mm that is aimed at."""

    name: str
    preset: Preset
    seeds: int
    frames: int
    target: float
    changes: Mapping[str, Any] = field(default_factory=dict)

    def configs(self, seeds: int | None, frames: int | None, width: int) -> list[SyntheticConfig]:
        """One for each of at most `seeds` seeds, of at most `frames` frames."""
        shorter = min(self.frames, frames or self.frames)
        values: dict[str, Any] = {"frames": shorter, "width": width, **self.changes}
        count = min(self.seeds, seeds or self.seeds)
        return [SyntheticConfig(self.preset, seed=FIRST_SEED + k, **values) for k in range(count)]


RENDERED = (
    RenderedRow("hand-held", Preset.TABLETOP, 3, 300, 5.0),
    RenderedRow("fast", Preset.TABLETOP, 3, 200, 20.0, {"pace": 3.0, "blur": 4}),
    RenderedRow("laps", Preset.LAPS, 1, 1800, 10.0),
    RenderedRow("bare wall", Preset.WALL, 3, 200, 20.0),
)


@dataclass(frozen=True, slots=True)
class MapperColumn:
    """A mapper: what its configuration changes; `alone` for its odometry by itself, `kiss` for KISS-ICP's own."""

    name: str
    title: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    alone: bool = False
    kiss: bool = False


COLUMNS = (
    MapperColumn("whole", "whole"),
    MapperColumn("no-objects", "without objects", {"smoother.joint": False}),
    MapperColumn("no-loops", "without loops", {"loops.enabled": False}),
    MapperColumn("no-visual", "without visual", {"visual.enabled": False}),
    MapperColumn("odometry", "its odometry alone", alone=True),
    MapperColumn("kiss-icp", "KISS-ICP alone", alone=True, kiss=True),
    MapperColumn("small-gicp", "small_gicp alone", {"odometry.source": OdometrySource.SMALL_GICP}, alone=True),
    MapperColumn(OWN_POSES, "its own poses", {"odometry.source": OdometrySource.POSES}, alone=True),
)


Place = tuple[Path, str, int | None]  # a sequence's folder, its detector, how many of its frames


@dataclass(frozen=True, slots=True)
class Job:
    """A sequence's folder, its detector, how many of its frames, by which mapper."""

    folder: Path
    detector: str
    frames: int | None
    column: MapperColumn


def run(job: Job) -> Measured:
    """Maps the sequence and measures the trajectory."""
    sequence = open_one(job.folder, job.frames)
    config = changed(MapperConfig(), job.column.changes)
    if job.column.alone:
        mapped = track_sequence(sequence, config, job.column.kiss)
    else:
        mapped = map_sequence(sequence, job.detector, config)
    return measure(mapped, sequence, open_surfaces(sequence))


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, map, measure, show; 2 for a user's mistake."""
    options = _options(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        try:
            rows, jobs = _plan(options, options.folder or Path(temporary))
            columns, left_out = _possible([column for column in COLUMNS if column.name in options.mappers])
            calls = {(row, n, c.name): (Job(*place, c),) for (row, n), place in jobs.items() for c in columns}
            measured = run_all(run, calls, options.jobs)
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    titles = {column.name: column.title for column in columns}
    results: Results = {(row.name, name): [] for row in rows for name in titles}
    for (row, _, name), one in measured.items():
        results[row, name].append(one)
    for title, text in describe(rows, titles, results, left_out).items():
        show_section(f"{TITLE}: {title}", text, options.write)
    return 0


def _plan(options: argparse.Namespace, folder: Path) -> tuple[list[Row], dict[tuple[str, int], Place]]:
    """Rows of the tables, and by row and number (folder, detector, frames) of every sequence; scenes are rendered."""
    rows: list[Row] = []
    jobs: dict[tuple[str, int], Place] = {}
    for path, detector in options.sequence:
        sequence = open_sequence(path)
        if sequence.poses is None:
            raise UserError(f"{path}: the sequence has no poses to compare with")
        if (sequence.name, 0) in jobs:
            raise UserError(f"{path}: there is another sequence named {sequence.name}; give one of them")
        make_detector(detector, sequence)  # a mistake is told before anything is mapped
        rows.append(Row(sequence.name, TARGETS.get(sequence.name), exact=False))
        jobs[sequence.name, 0] = Path(path), detector, options.frames
    for rendered in (row for row in RENDERED if row.name in options.rows):
        configs = rendered.configs(options.seeds, options.frames, options.width)
        rows.append(Row(rendered.name, rendered.target, exact=True))
        for n, config in enumerate(configs):
            jobs[rendered.name, n] = scene_folder(config, folder), f"simulated?seed={config.seed}", None
        run_all(render, {config.seed: (config, folder) for config in configs}, min(options.jobs, 1))
    return rows, jobs


def _possible(columns: Sequence[MapperColumn]) -> tuple[list[MapperColumn], list[str]]:
    """The mappers that this version's configuration can be, and why the others are left out."""
    possible, left_out = [], []
    for column in columns:
        try:
            changed(MapperConfig(), column.changes)
            possible.append(column)
        except UserError as error:
            left_out.append(f"{column.title}: {error}")
    return possible, left_out


def _sequence(words: Sequence[str]) -> tuple[str, str]:
    return words[0], words[1] if len(words) > 1 else NO_DETECTOR


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add, rows, names = parser.add_argument, [row.name for row in RENDERED], [column.name for column in COLUMNS]
    recorded = f"a recorded sequence with poses, and its detector (default {NO_DETECTOR}); may be given again"
    add("--sequence", nargs="+", action="append", default=[], metavar=("DIR", "DETECTOR"), help=recorded)
    add("--rows", nargs="*", choices=rows, default=rows, help="only these rendered sequences (default: all)")
    add("--mappers", nargs="+", choices=names, default=names, help="only these (default: all)")
    add("--seeds", type=int, metavar="N", help="at most so many scenes a row (default: 3, and 1 of laps)")
    add("--frames", type=int, metavar="N", help="at most so many frames of each")
    add("--width", type=int, default=WIDTH, metavar="PIXELS", help=f"of rendered images (default {WIDTH})")
    add("--folder", type=Path, metavar="DIR", help="keep rendered scenes there; scenes in it are used again")
    add("--jobs", type=int, default=2, metavar="N", help="at a time, in own processes; 0: in this one (default 2)")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if any(len(words) > 2 for words in options.sequence):
        parser.error("--sequence takes a folder and at most one detector")
    if min(options.seeds or 1, options.frames or 1) < 1 or options.jobs < 0:
        parser.error("--seeds and --frames count from 1, --jobs from 0")
    if options.write and (options.seeds or options.frames or options.width != WIDTH):
        parser.error("--write is for sequences of full number, length and size: without --seeds, --frames, --width")
    options.sequence = [_sequence(words) for words in options.sequence]
    return options


if __name__ == "__main__":
    sys.exit(main())
