"""What occlusion reasoning is worth: the next view's recall and precision of the full model and without its terms.

uv run python benchmarks/occlusion.py --write                all: 90 scenes, 2 GB, about 20 minutes on two cores
uv run python benchmarks/occlusion.py --quick                a scene a level, of seeds that are not held out
uv run python benchmarks/occlusion.py --folder DIR           goes on where it was interrupted
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from occlusion_bootstrap import CONFIDENCE, DRAWS, draw_scenes, measure
from occlusion_job import DETECTOR, Job, Stored, code_mark, missing, read, run
from occlusion_methods import ALWAYS, FULL, METHODS, VIEWS, Method
from occlusion_plots import write_plots
from occlusion_report import (
    ENOUGH,
    SHOWN,
    Results,
    calibration_table,
    class_table,
    cost_line,
    difference_tables,
    metric_tables,
    reliability_table,
    summary_table,
    verdict_table,
)
from results import RESULTS, show_section
from suite import FIRST_SEED, FRAMES, Scene

from thingmap.datasets.errors import UserError
from thingmap.datasets.synthetic.config import ClutterLevel, Preset
from thingmap.mapper.evaluation.boxes.outcomes import ALL
from thingmap.mapper.evaluation.result import VERSION

SCENES = 30  # of each clutter level
TRIED_SEED = 1  # seeds below `FIRST_SEED` may be looked at while something is built
PLOTS = RESULTS.with_name("plots")
Judged = dict[str, list[Stored]]  # by method, in the order of scenes


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, map, judge, show; 2 for a user's mistake."""
    options = _options(arguments)
    methods = [method for method in METHODS if method.name in options.variants]
    with tempfile.TemporaryDirectory() as temporary:
        folder, code = options.folder or Path(temporary), code_mark()
        seeds = range(options.first_seed, options.first_seed + options.scenes)
        jobs = {
            level: [Job(_scene(level, seed, options.frames), tuple(options.variants), folder, code) for seed in seeds]
            for level in ClutterLevel
        }
        try:
            _run_all([job for several in zip(*jobs.values(), strict=True) for job in several], options.jobs)
            judged = {level: _read_all(several, methods) for level, several in jobs.items()}
            _show(judged, options, PLOTS if options.write else options.folder and options.folder / "plots")
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    return 0


def _scene(level: ClutterLevel, seed: int, frames: int) -> Scene:
    return Scene(Preset.SURVEY, level, seed, frames)


def _run_all(jobs: Sequence[Job], workers: int) -> None:
    """A process for every scene that is not judged by all: no scene finds what another has left in memory."""
    start, jobs = time.perf_counter(), [job for job in jobs if missing(job)]
    if not jobs:
        return
    with multiprocessing.get_context("spawn").Pool(workers, maxtasksperchild=1) as pool:
        for number, job in enumerate(pool.imap_unordered(run, jobs), start=1):
            minutes = (time.perf_counter() - start) / 60.0
            print(f"{number}/{len(jobs)} after {minutes:.1f} min: {job.scene.name}", file=sys.stderr, flush=True)


def _read_all(jobs: Sequence[Job], methods: Sequence[Method]) -> Judged:
    judged: Judged = {}
    for method in methods:
        stored = [read(job, method) for job in jobs]
        judged[method.name] = [one for one in stored if one is not None]
        if len(judged[method.name]) < len(jobs):
            raise UserError(
                f"{jobs[0].folder}: judgements were written and are gone; is something else using the folder?"
            )
    return judged


def pool_scenes(judged: Judged, label: str = ALL) -> Results:
    """All scenes of a level as one, by method and number of views; every method with the same draws of scenes."""
    weights = draw_scenes(max(len(several) for several in judged.values()))
    results: dict[str, dict] = {}
    for name, several in judged.items():
        outcomes = [stored.judgement.outcomes for stored in several]
        lengths = [views for views in VIEWS if any((views, label) in one for one in outcomes)]
        results[name] = {n: measure([one.get((n, label)) for one in outcomes], weights) for n in lengths}
    return results


def _show(judged: Mapping[ClutterLevel, Judged], options: argparse.Namespace, plots: Path | None) -> None:
    levels = {level: pool_scenes(several) for level, several in judged.items()}
    pictures = {} if plots is None else write_plots(levels, plots)
    links = {name: f"![{name}]({file.parent.name}/{file.name})" for name, file in pictures.items()}
    stored = [one for several in judged.values() for by_method in several.values() for one in by_method]
    sections = {
        "what it shows": [
            _head(options),
            summary_table(levels),
            verdict_table(levels),
            links.get("views"),
            cost_line((one.seconds for one in stored), options.jobs),
        ],
        **{f"{level} clutter": _level_texts(judged[level], levels[level], links, level) for level in levels},
        "calibration": _calibration_texts(judged, options),
    }
    for title, texts in sections.items():
        show_section(f"Occlusion: {title}", "\n\n".join(filter(None, texts)), options.write)


def _head(options: argparse.Namespace) -> str:
    seeds = f"seeds {options.first_seed} to {options.first_seed + options.scenes - 1}"
    return (
        f"{options.scenes} `survey` scenes of {options.frames} frames a clutter level, {seeds}; detections of "
        f"`{DETECTOR.format(seed='SEED')}`, SEED being the scene's, the same for all mappers; evaluator {VERSION}. The "
        f"full model's lead in points, mean over {ENOUGH} to {max(VIEWS)} views, with the {CONFIDENCE:.0%} interval of "
        f"{DRAWS} draws of scenes; at how many of these numbers of views it is ahead. The detector alone has seen the "
        "view that all are judged in; the maps have not."
    )


def _level_texts(judged: Judged, results: Results, links: Mapping[str, str], level: ClutterLevel) -> list[str | None]:
    labels = {label for one in judged[FULL.name] for _, label in one.judgement.outcomes} - {ALL}
    by_class = {label: pool_scenes(judged, label) for label in sorted(labels)}
    return [
        metric_tables(results),
        difference_tables(results),
        f"Average precision by class after {', '.join(map(str, SHOWN))} views:",
        class_table(by_class),
        links.get(f"recall {level}"),
    ]


def _calibration_texts(judged: Mapping[ClutterLevel, Judged], options: argparse.Namespace) -> list[str]:
    claims = {
        level.value: [one.judgement.claims for one in several[FULL.name] if one.judgement.claims is not None]
        for level, several in judged.items()
    }
    everything = [one for several in claims.values() for one in several]
    return [
        f"The full model's maps of all {options.frames} frames, doubtful things too; all claims of a row's scenes "
        "together. Existence is right where a thing stands for an object, its class where that object is of it.",
        calibration_table({**claims, "all": everything}),
        reliability_table(everything),
    ]


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add, names, frames = parser.add_argument, [method.name for method in METHODS], FRAMES[Preset.SURVEY]
    always = [method.name for method in ALWAYS]
    which = f"only these, and the full model; of {', '.join(names)} (default: {', '.join(always)})"
    add("--scenes", type=int, metavar="N", help=f"of each clutter level (default {SCENES})")
    add("--first-seed", type=int, metavar="SEED", help=f"of the scenes (default {FIRST_SEED}, those held out)")
    add("--frames", type=int, default=frames, metavar="N", help=f"of a scene (default {frames})")
    add("--variants", nargs="+", choices=names, default=always, metavar="NAME", help=which)
    add("--quick", action="store_true", help="one scene a level, not one of those held out; not for RESULTS.md")
    add("--folder", type=Path, metavar="DIR", help="keep scenes and judgements there; those in it are used again")
    add("--jobs", type=int, default=2, metavar="N", help="scenes at a time (default 2)")
    add("--write", action="store_true", help="put the results into RESULTS.md, its pictures into plots/")
    options = parser.parse_args(arguments)
    few = (1, TRIED_SEED) if options.quick else (SCENES, FIRST_SEED)
    given = options.scenes, options.first_seed
    options.scenes, options.first_seed = (d if g is None else g for g, d in zip(given, few, strict=True))
    options.variants = [name for name in names if name in {FULL.name, *options.variants}]
    if options.scenes < 1 or options.jobs < 1 or options.first_seed < 0 or options.frames <= max(VIEWS):
        parser.error(f"--scenes and --jobs count from 1, --first-seed from 0, --frames from {max(VIEWS) + 1}")
    held_out = options.scenes >= SCENES and options.first_seed == FIRST_SEED and options.frames == frames
    if options.write and not (held_out and set(always) <= set(options.variants)):
        rule = f"{SCENES} scenes or more of {frames} frames, from seed {FIRST_SEED} on, and all variants"
        parser.error(f"--write is for the whole benchmark: {rule}")
    return options


if __name__ == "__main__":
    sys.exit(main())
