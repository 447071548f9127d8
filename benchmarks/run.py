"""The frozen suite: rendered scenes, the mapper with and without its parts, judged by `thingmap evaluate`'s protocols.

uv run python benchmarks/run.py --write                     all of it: about 40 minutes on two cores, 4.5 GB of scenes
uv run python benchmarks/run.py --quick                     one short scene of each preset and clutter level
uv run python benchmarks/run.py --presets survey            one preset
"""

from __future__ import annotations

import argparse
import itertools
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from results import show_section
from suite import PRESETS, VARIANTS, WHOLE, Scene, Variant, scenes
from suite_job import is_rendered, judge, read_judgement, render
from suite_report import COST_COLUMNS, IMAGE_COLUMNS, OBJECT_COLUMNS, Row, honesty_table, metric_table, next_view_table

from thingmap.datasets.errors import UserError
from thingmap.datasets.synthetic.config import ClutterLevel, Preset
from thingmap.mapper.evaluation.result import VERSION

QUICK_FRAMES = 120
GROUPED = ("preset", "clutter")


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, map, judge, show; 2 for a user's mistake."""
    options = _options(arguments)
    frames, seeds = (QUICK_FRAMES, 1) if options.quick else (None, None)
    suite = scenes(tuple(Preset(name) for name in options.presets), seeds, frames)
    variants = [variant for variant in VARIANTS if variant.name in options.variants]
    jobs = [(scene, variant) for variant in variants for scene in suite if scene.preset in variant.presets]
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        try:
            _all("rendered", render, [(scene, folder) for scene in suite if not is_rendered(scene, folder)], 1)
            _all("judged", judge, [(scene, variant, folder) for scene, variant in jobs], options.jobs)
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
        _show(variants, jobs, folder, options)
    return 0


def _all(done: str, work: Callable[..., None], calls: list[tuple[Any, ...]], workers: int) -> None:
    """Every call in a process of its own, so that peak memory is one run's and a later one finds nothing warm."""
    context, start = multiprocessing.get_context("spawn"), time.perf_counter()
    with context.Pool(workers, maxtasksperchild=1) as pool:
        for number, call in enumerate(pool.imap_unordered(partial(_call, work), calls), start=1):
            what = " ".join(part.name for part in call if isinstance(part, Scene | Variant))
            minutes = (time.perf_counter() - start) / 60.0
            print(f"{done} {number}/{len(calls)} after {minutes:.1f} min: {what}", file=sys.stderr, flush=True)


def _call(work: Callable[..., None], call: tuple[Any, ...]) -> tuple[Any, ...]:
    work(*call)
    return call


def _show(
    variants: list[Variant], jobs: list[tuple[Scene, Variant]], folder: Path, options: argparse.Namespace
) -> None:
    whole = [scene for scene, variant in jobs if variant == WHOLE]
    head = f"{len({scene for scene, _ in jobs})} scenes, evaluator {VERSION}; means over a row's scenes."
    if whole:
        rows = list(_by_preset(whole, folder))
        survey = [row for row in rows if row[0][0] == Preset.SURVEY]
        cost = "\n\n".join([metric_table(GROUPED, COST_COLUMNS, rows), _cost_note(options.jobs)])
        sections = {
            "objects": metric_table(GROUPED, OBJECT_COLUMNS, rows),
            "image boxes and points": metric_table(GROUPED, IMAGE_COLUMNS, rows),
            "the next view": next_view_table(GROUPED, survey) if survey else "",
            "honesty": honesty_table(GROUPED, rows),
            "cost": cost,
        }
        for title, text in sections.items():
            if text:
                show_section(f"Suite: {title}", f"{head}\n\n{text}", options.write)
    if len(variants) > 1:
        show_section("Suite: ablations", f"{head}\n\n{_ablations(variants, jobs, folder)}", options.write)


def _by_preset(whole: list[Scene], folder: Path) -> Iterable[Row]:
    """What the whole mapper made of the scenes of each preset and clutter level."""
    for preset, clutter in itertools.product(PRESETS, ClutterLevel):
        group = [scene for scene in whole if (scene.preset, scene.clutter) == (preset, clutter)]
        if group:
            yield (preset.value, clutter.value), [read_judgement(scene, WHOLE, folder) for scene in group]


def _ablations(variants: list[Variant], jobs: list[tuple[Scene, Variant]], folder: Path) -> str:
    """Every variant on the scenes that all of them have mapped, by clutter level."""
    common = set.intersection(*({scene for scene, v in jobs if v is variant} for variant in variants))
    texts = []
    for clutter in ClutterLevel:
        group = sorted((scene for scene in common if scene.clutter is clutter), key=lambda scene: scene.name)
        rows = [((v.title,), [read_judgement(scene, v, folder) for scene in group]) for v in variants]
        if group:
            objects, honesty = metric_table(["mapper"], OBJECT_COLUMNS, rows), honesty_table(["mapper"], rows)
            texts.append(f"Clutter {clutter}:\n\n{objects}\n\n{honesty}")
    return "\n\n".join(texts)


def _cost_note(jobs: int) -> str:
    return f"Reading from disk, recorded frames, simulated detections; {jobs} scenes mapped at a time on this machine."


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add, presets, names = parser.add_argument, [preset.value for preset in PRESETS], [v.name for v in VARIANTS]
    add("--presets", nargs="+", choices=presets, default=presets, help="only these (default: all)")
    add("--variants", nargs="+", choices=names, default=names, help="only these mappers (default: all)")
    add("--quick", action="store_true", help=f"one scene each, of at most {QUICK_FRAMES} frames; not for RESULTS.md")
    add("--folder", type=Path, metavar="DIR", help="keep scenes, maps and reports there; scenes in it are used again")
    add("--jobs", type=int, default=2, metavar="N", help="scenes mapped at a time (default 2)")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.write and options.quick:
        parser.error("--write is for the whole suite, not for --quick")
    return options


if __name__ == "__main__":
    sys.exit(main())
