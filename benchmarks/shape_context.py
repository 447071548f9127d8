"""The experiments of Georgakis et al.'s Table II on rendered tables: single view, multi-view, 3D point labelling.

uv run python benchmarks/shape_context.py --folder DIR --write     all of it, about an hour on two cores
uv run python benchmarks/shape_context.py --quick                  short scenes, and a model of a minute's training

Every 5th frame of tabletop scenes at three levels of clutter, of seeds that nothing was tried on. The detector is the
shipped one (see shape_context_model.py). Multi-view as the paper does it, and the full graph, each with the true poses
as in the paper and with those that the mapper estimates; all get the same detections. "Judged tracks" are the same
ones, but a `TrackJudge` decides what they are, and they are drawn into every frame that could show them. Thresholds are
those of the best F1 on other scenes of seeds below 1000 (of judged tracks, that at which they are more precise there
than single views by a margin), and what the graph and the judge know of the detector is from such scenes too.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from judging import judge_all
from results import show_section
from shape_context_evidence import evidence_file, learn_evidence
from shape_context_job import GRAPHS, JUDGES, TRACKS, Job, JudgedScene, Mode, judge_scene
from shape_context_judge import judge_file, learn_judge
from shape_context_model import model_file, train_model
from shape_context_report import (
    MARGIN,
    Row,
    Thresholds,
    box_row,
    level_table,
    point_row,
    recall_table,
    result_table,
    thresholds,
    verdicts,
)
from suite import FIRST_SEED, Scene

from thingmap.datasets.errors import UserError
from thingmap.datasets.synthetic.config import ClutterLevel, Preset
from thingmap.detectors.shape_context.model import shipped_model

TITLE = "Shape-context detector: views, tracks and the graph"
SEEDS, FRAMES = 3, 300  # scenes of each level of clutter that are judged
THRESHOLD_SEEDS, THRESHOLD_FRAMES = (4, 5, 6), 150  # where thresholds are chosen, and nothing was learned
QUICK_FRAMES = 20


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, train if need be, judge, show; 2 for a user's mistake."""
    options = _options(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        try:
            model = detector_model(folder, options.quick, options.own_model)
            evidence = evidence_file(folder, model)
            if not (options.reuse and evidence.is_file()):
                learn_evidence(model, folder, options.quick)
            judge = judge_file(folder, model)
            if not (options.reuse and judge.is_file()):
                learn_judge(model, folder, options.quick)
            known = folder, model, evidence, judge
            jobs = [Job(s, *known) for s in threshold_scenes(options.quick)]
            limits = thresholds(judge_all(judge_scene, jobs, options.jobs))
            jobs = [Job(s, *known, limits) for s in held_out_scenes(options.quick)]
            judged = judge_all(judge_scene, jobs, options.jobs)
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    show_section(TITLE, describe(judged, limits), options.write)
    return 0


def detector_model(folder: Path, quick: bool, own: bool) -> Path:
    """The shipped model, or that of the folder, trained if it is not there."""
    if not quick and not own:
        return shipped_model()
    file = model_file(folder, quick=quick)
    return file if file.is_file() else train_model(folder, quick)


def held_out_scenes(quick: bool = False) -> list[Scene]:
    """What is judged."""
    seeds, frames = (1, QUICK_FRAMES) if quick else (SEEDS, FRAMES)
    return [Scene(Preset.TABLETOP, level, FIRST_SEED + k, frames) for level in ClutterLevel for k in range(seeds)]


def threshold_scenes(quick: bool = False) -> list[Scene]:
    """Where thresholds come from."""
    seeds, frames = (THRESHOLD_SEEDS[:1], QUICK_FRAMES) if quick else (THRESHOLD_SEEDS, THRESHOLD_FRAMES)
    return [Scene(Preset.TABLETOP, level, seed, frames) for level in ClutterLevel for seed in seeds]


def describe(judged: Sequence[JudgedScene], limits: Thresholds) -> str:
    """Markdown: whether aims are reached, boxes and points by class, boxes by level of clutter."""
    boxes = _rows(judged, limits)
    points = {f"points, {mode}": point_row(judged, mode) for mode in (*TRACKS, *JUDGES, *GRAPHS)}
    groups = {str(level): _rows(_of(judged, level), limits) for level in ClutterLevel}
    chosen = ", ".join(f"{mode} {limits[mode]:.3f}" if limits[mode] is not None else f"{mode} none" for mode in Mode)
    frames = sum(len(scene.matches[Mode.SINGLE]) for scene in judged)
    return "\n\n".join(
        [
            verdicts(boxes),
            f"Precision / recall (%) of boxes in {frames} frames of {len(judged)} scenes, and of labelled points:",
            result_table({**boxes, **points}),
            "Recall (%) of boxes at equal precision, all classes together, thresholds by hindsight:",
            recall_table(judged),
            "Boxes, means over the classes of objects, by clutter:",
            level_table(groups),
            f"Thresholds: {chosen}. Detector: {np.median([scene.milliseconds for scene in judged]):.0f} ms a frame, "
            "beside other jobs. The tracks are those of the paper with the share of 60 % taken of the views that could "
            "show a track; they are ranked by what their views say on average. Judged tracks are drawn into every "
            "frame that could show them; at the threshold their precision on other scenes is that of single views and "
            f"{100.0 * MARGIN:.0f} points. Things of a graph are drawn into every frame, hidden there or not.",
        ]
    )


def _rows(judged: Sequence[JudgedScene], limits: Thresholds) -> dict[str, Row]:
    return {mode: box_row(judged, mode, limits[mode]) for mode in Mode}


def _of(judged: Iterable[JudgedScene], level: ClutterLevel) -> list[JudgedScene]:
    return [scene for scene in judged if scene.job.scene.clutter == level]


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--folder", type=Path, metavar="DIR", help="keep scenes, models and maps there; scenes in it are used again")
    add("--quick", action="store_true", help="a short scene each, and a model of a minute's training")
    add(
        "--own-model", action="store_true", help="take the folder's model (shape_context_model.py), not the shipped one"
    )
    add(
        "--reuse",
        action="store_true",
        help="take what DIR holds of the graph's and the judge's knowledge of this detector",
    )
    add("--jobs", type=int, default=2, metavar="N", help="scenes judged at a time (default 2)")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.write and (options.quick or options.own_model):
        parser.error("--write is for the shipped model on all scenes")
    if options.jobs < 1:
        parser.error("--jobs counts from 1")
    return options


if __name__ == "__main__":
    sys.exit(main())
