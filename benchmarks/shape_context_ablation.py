"""Each class's detector by itself, as in Table I of Georgakis et al., and without one part of it at a time.

uv run python benchmarks/shape_context_ablation.py --folder DIR --write     about twenty minutes on two cores

A class's detector claims every proposal that it has a verified hypothesis for, by its normalised score; nothing is
calibrated, and classes do not compete. All variants have the shipped codebooks: what differs is how images are looked
at. Scenes are those of shape_context.py, every 15th frame.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numba
import numpy as np
from results import show_section, table
from shape_context import detector_model, held_out_scenes
from shape_context_boxes import JUDGED, class_numbers, truth_of
from suite import Scene
from suite_job import is_rendered, render, scene_folder

from thingmap.datasets.errors import UserError
from thingmap.datasets.open import open_sequence
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.synthetic.things.models import CLASSES
from thingmap.detectors.shape_context.config import Context, VotingConfig
from thingmap.detectors.shape_context.detector import ShapeContextDetector
from thingmap.detectors.shape_context.model import load_model
from thingmap.mapper.evaluation.boxes.curves import Scored, average_precision
from thingmap.mapper.evaluation.boxes.image_boxes import EDGE, found_boxes
from thingmap.mapper.evaluation.boxes.matching import Matches, match_boxes, scored

TITLE = "Shape-context detector: each class by itself"
STEP, QUICK_STEP = 15, 10
FULL = "full"
WITHOUT = {
    "without pruning": "equation (1)",
    "without radius scaling": "r = r_t z_t / z",
    "contexts of the image": "descriptors of the proposal's own edges",
}


@dataclass(frozen=True, slots=True)
class Job:
    """A rendered scene in a folder, every how many frames it is looked at, by which model."""

    scene: Scene
    folder: Path
    model: Path
    step: int


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, detect, show; 2 for a user's mistake."""
    options = _options(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        try:
            model = detector_model(folder, options.quick, options.own_model)
            step = QUICK_STEP if options.quick else STEP
            jobs = [Job(scene, folder, model, step) for scene in held_out_scenes(options.quick)]
            for job in jobs:
                if not is_rendered(job.scene, folder):
                    render(job.scene, folder)
            with multiprocessing.get_context("spawn").Pool(options.jobs, numba.set_num_threads, (1,)) as pool:
                judged = []
                for job, one in zip(jobs, pool.imap(judge_scene, jobs), strict=True):
                    judged.append(one)
                    print(f"judged {job.scene.name}", file=sys.stderr, flush=True)
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    together = {name: [match for one in judged for match in one[name]] for name in judged[0]}
    show_section(TITLE, describe(together), options.write)
    return 0


def variants(voting: VotingConfig) -> dict[str, VotingConfig]:
    """The detector's own voting, and that without each part."""
    return {
        FULL: voting,
        # of a class there may then be several in the one heat map of the image, strong and weak
        "without pruning": replace(voting, prune=False, maxima=20, min_score=voting.min_score / 3.0),
        "without radius scaling": replace(voting, scale_radius=False),
        "contexts of the image": replace(voting, context=Context.IMAGE),
    }


def judge_scene(job: Job) -> dict[str, list[Matches]]:
    """Of every variant, the claims of all classes' detectors in every frame looked at.

    Raises:
        UserError: the scene or the model cannot be read.
    """
    place, model = scene_folder(job.scene, job.folder), load_model(job.model)
    truth, sequence = open_truth(place), open_sequence(place)
    number = class_numbers(model.classes, truth)
    assert truth.intrinsics is not None
    detectors = {name: ShapeContextDetector(model, voting=voting) for name, voting in variants(model.voting).items()}
    matches: dict[str, list[Matches]] = {name: [] for name in detectors}
    for index in range(0, len(sequence), job.step):
        frame, true = sequence[index], truth_of(truth, index)
        for name, detector in detectors.items():
            scored = detector.score(frame)
            found, scores = scored.proposals, scored.scores
            rows, columns = np.nonzero(np.isfinite(scores.normalised))
            claims = found.xyxy[rows] - EDGE, number[columns], scores.normalised[rows, columns]
            matches[name].append(match_boxes(found_boxes(*claims, truth.intrinsics), true, JUDGED.box_iou, index))
    return matches


def describe(matches: dict[str, list[Matches]], classes: Sequence[str] = CLASSES) -> str:
    """Markdown: what each part is worth, and average precision by class."""
    ranked = {name: [scored(several, number) for number in range(len(classes))] for name, several in matches.items()}
    means = {name: _mean_precision(one) for name, one in ranked.items()}
    lines = []
    for name, part in WITHOUT.items():
        gain = 100.0 * (means[FULL] - means[name])
        lines.append(f"- {part}: {gain:+.1f} points of mean AP; it {'helps' if gain > 0.0 else 'does NOT help'}.")
    rows = [
        (label, ranked[FULL][number].objects, *(_shown(one[number]) for one in ranked.values()))
        for number, label in enumerate(classes)
    ]
    total = sum(one.objects for one in ranked[FULL])
    rows.append(("**mean**", total, *(f"**{100.0 * value:.1f}**" for value in means.values())))
    images = len(matches[FULL])
    head = f"AP (%) at IoU {JUDGED.box_iou:g}, {images} frames (paper, Table I: 69.5 with everything, of six classes):"
    return "\n".join([*lines, "", head, "", table(("class", "objects in frames", *ranked), rows)])


def _mean_precision(ranked: Sequence[Scored]) -> float:
    known = [value for one in ranked if (value := average_precision(one)) is not None]
    return float(np.mean(known)) if known else 0.0


def _shown(one: Scored) -> str:
    value = average_precision(one)
    return "-" if value is None else f"{100.0 * value:.1f}"


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--folder", type=Path, metavar="DIR", help="keep scenes and models there; those in it are used again")
    add("--quick", action="store_true", help="a short scene each, and a model of a minute's training")
    add("--own-model", action="store_true", help="take the model in DIR (shape_context_model.py), not the shipped one")
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
