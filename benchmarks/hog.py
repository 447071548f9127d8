"""How well the HOG detector finds the synthetic classes in rooms it has not seen, and what occlusion does to it.

uv run python benchmarks/hog.py --folder DIR --write        all of it: scenes, two models to train, an hour on two cores
uv run python benchmarks/hog.py --quick                     one scene each, and models of a minute's training

The model on colour and depth is the shipped one. Those on colour or depth alone are trained by `hog_model.py` in the
same way; what is in DIR is used again. Templates are judged, without what a second stage makes of their windows.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from multiprocessing.pool import Pool
from pathlib import Path

import numba
import numpy as np
from hog_job import Job, JudgedScene, judge_scene
from hog_model import model_file, train_model
from hog_painted import PaintJob, paint_scene, painted_table
from hog_report import (
    FALSE_PER_IMAGE,
    Groups,
    all_matches,
    halves_table,
    mean_precision,
    occlusion_table,
    part_table,
    precision_table,
    speed_line,
    trend_lines,
)
from results import show_section
from suite import FIRST_SEED, Scene
from suite_job import is_rendered, render

from thingmap.datasets.errors import UserError
from thingmap.datasets.synthetic.config import ClutterLevel, Preset
from thingmap.datasets.synthetic.things.models import CLASSES
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.model import shipped_model

# preset, frames, scenes of each level, every how many frames
SCENES = ((Preset.TABLETOP, 300, 3, 5), (Preset.SURVEY, 37, 10, 5), (Preset.KITCHEN, 900, 1, 15))
QUICK_SCENES = ((Preset.TABLETOP, 20, 1, 5),)
PAINTED, QUICK_PAINTED = 90, 3  # objects of a preset and level of clutter that are painted over, at most
LEVELS = (ClutterLevel.LOW, ClutterLevel.HIGH)
MODELS = {Channels.RGB: "RGB", Channels.DEPTH: "depth", Channels.RGBD: "RGB-D"}  # in the paper's rising order
AIM = 0.70  # mean average precision on colour and depth, in low clutter


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, train, judge, show; 2 for a user's mistake."""
    options = _options(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        try:
            models = {name: _model(folder, channels, options) for channels, name in MODELS.items()}
            groups = judge_all(models, folder, options.quick, options.first_seed, options.jobs)
            painted = paint_all(models[MODELS[Channels.RGBD]], folder, options)
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    note = f"Scenes of seeds from {options.first_seed} on. Detector: {speed_line(groups)} a frame, beside other jobs."
    show_section("HOG detector: average precision", f"{describe_precision(groups)}\n\n{note}", options.write)
    show_section("HOG detector: parts and occlusion", describe_occlusion(groups, painted), options.write)
    return 0


def judge_all(models: dict[str, Path], folder: Path, quick: bool, first_seed: int, jobs: int) -> Groups:
    """Everything that is judged, by preset and level of clutter."""
    scenes = list(_scenes(quick, first_seed))
    for scene, _ in scenes:
        if not is_rendered(scene, folder):
            render(scene, folder)
    # The halves are looked at with the best model only: the question is what occlusion does, not what depth does.
    work = [
        Job(scene, step, file, folder, name == MODELS[Channels.RGBD])
        for scene, step in scenes
        for name, file in models.items()
    ]
    names = {file: name for name, file in models.items()}
    groups: dict[str, dict[str, list[JudgedScene]]] = {}
    start = time.perf_counter()
    with _pool(jobs) as pool:
        for number, judged in enumerate(pool.imap(judge_scene, work), start=1):
            scene = judged.job.scene
            by_model = groups.setdefault(f"{scene.preset}, {scene.clutter}", {name: [] for name in models})
            by_model[names[judged.job.model]].append(judged)
            minutes = (time.perf_counter() - start) / 60.0
            print(f"judged {number}/{len(work)} after {minutes:.1f} min: {scene.name}", file=sys.stderr, flush=True)
    return groups


def paint_all(model: Path, folder: Path, options: argparse.Namespace) -> list[np.ndarray]:
    """What is made of objects painted over, in the scenes that `judge_all` has rendered: as `paint_scene`, of each."""
    scenes = list(_scenes(options.quick, options.first_seed))
    seeds = Counter((scene.preset, scene.clutter) for scene, _ in scenes)
    most = QUICK_PAINTED if options.quick else PAINTED
    work = [
        PaintJob(scene, step, model, folder, math.ceil(most / seeds[scene.preset, scene.clutter]))
        for scene, step in scenes
    ]
    with _pool(options.jobs) as pool:
        return list(pool.imap(paint_scene, work))


def describe_precision(groups: Groups) -> str:
    """Markdown: average precision of every class in every group, and whether the paper's order is there."""
    best = MODELS[Channels.RGBD]
    verdicts = []
    for group, by_model in groups.items():
        means = {name: mean_precision(all_matches(judged), CLASSES) or 0.0 for name, judged in by_model.items()}
        leads = all(means[best] > value for name, value in means.items() if name != best)
        order = ", ".join(f"{name} {value:.3f}" for name, value in sorted(means.items(), key=lambda item: item[1]))
        aim = ""
        if group.endswith(f", {ClutterLevel.LOW}"):
            aim = f"; {best} {'reaches' if means[best] >= AIM else 'does NOT reach'} {AIM:.2f}"
        verdicts.append(f"- {group}: {order}; {best} is {'best' if leads else 'NOT best'}{aim}.")
    return "\n".join([*verdicts, "", precision_table(groups)])


def describe_occlusion(groups: Groups, painted: Sequence[np.ndarray]) -> str:
    """Markdown: each template on its own half, and by occlusion: as scenes have it, and painted."""
    best = MODELS[Channels.RGBD]
    judged = [scene for by_model in groups.values() for scene in by_model[best]]
    return "\n\n".join(
        [
            f"Templates of {best}, mean average precision, each judged on its own half of the true box:",
            part_table(groups, best),
            trend_lines(judged),
            f"All scenes together, objects whole in the image, by how much of them is hidden: recall at "
            f"{FALSE_PER_IMAGE:g} false box an image of each template, and the mean probability of the object's own "
            "class at its true place:",
            occlusion_table(judged),
            "Objects of which one half is seen, by how much of the opposite half is hidden; mean probability at the "
            "true place:",
            halves_table(judged),
            "Objects that are seen well, one half painted over from its far side inwards with background that stands "
            "before them; mean probability at the true place:",
            painted_table(painted),
        ]
    )


def _pool(jobs: int) -> Pool:
    return multiprocessing.get_context("spawn").Pool(jobs, initializer=numba.set_num_threads, initargs=(1,))


def _model(folder: Path, channels: Channels, options: argparse.Namespace) -> Path:
    """The shipped model, one that is in the folder, or one trained now."""
    if channels is Channels.RGBD and not options.quick and not options.own_model:
        return shipped_model()
    file = model_file(folder, channels, options.quick)
    return file if file.is_file() else train_model(folder, channels, options.quick)


def _scenes(quick: bool, first_seed: int) -> Iterator[tuple[Scene, int]]:
    for preset, frames, seeds, step in QUICK_SCENES if quick else SCENES:
        for clutter in LEVELS:
            for k in range(seeds):
                yield Scene(preset, clutter, first_seed + k, frames), step


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--folder", type=Path, metavar="DIR", help="keep scenes and models there; those in it are used again")
    add("--quick", action="store_true", help="a short scene each, and models of a minute's training")
    add("--own-model", action="store_true", help="on colour and depth too take the folder's model, not the shipped one")
    add("--first-seed", type=int, default=FIRST_SEED, metavar="N", help=f"of the scenes (default {FIRST_SEED})")
    add("--jobs", type=int, default=2, metavar="N", help="scenes judged at a time (default 2)")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.write and (options.quick or options.own_model or options.first_seed != FIRST_SEED):
        parser.error("--write is for the shipped model on all scenes")
    if options.first_seed < 0 or options.jobs < 1:
        parser.error("--first-seed counts from 0, --jobs from 1")
    return options


if __name__ == "__main__":
    sys.exit(main())
