"""Proposals as a class-agnostic detector: recall of true things, how many it takes, how honest its scores, how fast.

uv run python benchmarks/proposals.py --label-fusion ../shared/data/label_fusion/labels --write
uv run python benchmarks/proposals.py --scenes 0 --pictures OUT --show ../shared/data/redkitchen --show synth:tabletop

A thing is found where a proposal overlaps its visible pixels by half or more (intersection over union). Rendered scenes
have seeds of 1000 and more, which nothing was tried on. Pictures are for looking at.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import label_fusion
import numpy as np
import proposal_pictures
from proposal_scores import report
from proposal_truth import FARTHEST, LEAST_PIXELS, Match, match, rendered
from results import show_section, table
from timing import least_ms

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame
from thingmap.datasets.open import open_sequence
from thingmap.detectors.proposals.config import ProposalConfig
from thingmap.detectors.proposals.detector import ProposalDetector
from thingmap.detectors.proposals.objectness import proposal_features, shipped_objectness
from thingmap.detectors.proposals.planes import find_planes
from thingmap.detectors.proposals.point_grid import point_grid
from thingmap.detectors.proposals.proposals import cluster_image, describe, find_proposals, pieces_of_things

TITLE = "Proposals"
FIRST_SEED, FRAMES, SHOWN = 1300, 6, 6
KINDS = (
    "tabletop?clutter=low",
    "tabletop?clutter=medium",
    "tabletop?clutter=high",
    "survey?clutter=medium",
    "kitchen?clutter=medium",
)
CONFIDENCE = ProposalDetector().confidence
REPEATS = 15


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """One image: what matched, and the probabilities of its proposals."""

    kind: str
    match: Match
    probability: np.ndarray


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, draw, and write if asked to; 2 for a user's mistake."""
    options = _options(arguments)
    try:
        texts = []
        if options.scenes:
            judged, timed = judge_rendered(options.scenes)
            texts += [rendered_table(judged), calibration(judged), stage_table(timed)]
        if options.label_fusion:
            texts.append(labelled_table(options.label_fusion))
        if options.pictures:
            draw_all(options)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if texts:
        show_section(TITLE, "\n\n".join(texts), options.write)
    return 0


def judge_rendered(scenes: int) -> tuple[list[Judged], list[Frame]]:
    """So many scenes of every kind; and one frame of each kind, for timing."""
    judged, frames = [], {}
    for kind in KINDS:
        lines = [f"synth:{kind}&seed={FIRST_SEED + k}" for k in range(scenes)]
        for line, frame, instances, objects in rendered(lines, FRAMES):
            judged.append(judge(kind, frame, instances, objects))
            frames.setdefault(kind, frame)
            print(f"{line} {frame.name}: {len(judged[-1].probability)} proposals", file=sys.stderr, flush=True)
    return judged, list(frames.values())


def judge(kind: str, frame: Frame, instances: np.ndarray, objects: int) -> Judged:
    """The proposals of one image."""
    config = ProposalConfig()
    found = find_proposals(frame, config)
    probability = shipped_objectness()(proposal_features(found, config))
    return Judged(kind, match(found, instances, frame.depth, objects), probability)


def rendered_table(judged: list[Judged]) -> str:
    """Markdown: recall and number of proposals by kind of scene."""
    rows = [_row(kind, [j for j in judged if j.kind == kind]) for kind in KINDS] + [_row("all", judged)]
    head = (
        "scenes", "images", "objects", "found", "clutter", "found", "proposals an image",
        f"objects found at p >= {CONFIDENCE:g}", "detections an image", "precision",
    )  # fmt: skip
    return (
        f"Rendered scenes of seeds from {FIRST_SEED}: things of at least {LEAST_PIXELS} visible pixels, within "
        f"{FARTHEST:g} m, half of whose pixels have a depth. Objects are of the scene's classes, clutter of none.\n\n"
        + table(head, rows)
    )


def _row(name: str, judged: list[Judged]) -> tuple[str, ...]:
    asked = np.concatenate([j.match.counts for j in judged])
    is_object = np.concatenate([j.match.is_object for j in judged])
    found = np.concatenate([j.match.found for j in judged])
    sure = np.concatenate([_found_by(j.match, j.probability >= CONFIDENCE) for j in judged])
    right = np.concatenate([j.match.right[j.probability >= CONFIDENCE] for j in judged])
    objects, clutter = asked & is_object, asked & ~is_object
    count = sum(len(j.probability) for j in judged)
    return (
        name, str(len(judged)), str(objects.sum()), f"{found[objects].mean():.3f}", str(clutter.sum()),
        f"{found[clutter].mean():.3f}" if clutter.any() else "-", f"{count / len(judged):.1f}",
        f"{sure[objects].mean():.3f}", f"{len(right) / len(judged):.1f}", f"{right.mean():.3f}",
    )  # fmt: skip


def _found_by(found: Match, kept: np.ndarray) -> np.ndarray:
    return found.iou[:, kept].max(axis=1, initial=0.0) >= 0.5


def calibration(judged: list[Judged]) -> str:
    """Markdown: how honest the probabilities are."""
    probability = np.concatenate([j.probability for j in judged])
    return "Probabilities on these scenes: " + report(probability, np.concatenate([j.match.right for j in judged]))


def labelled_table(folder: Path) -> str:
    """Markdown: recall of the labelled things of recorded views."""
    views = label_fusion.read_label_fusion(folder)
    judged = [judge("", view.frame, view.instances, 1000) for view in views]
    things = sorted({k for view in views for k in np.unique(view.instances).tolist() if k >= 0})
    rows = []
    for thing in things:
        best = [
            j.match.iou[np.unique(v.instances)[1:] == thing].max(initial=0.0)
            for v, j in zip(views, judged, strict=True)
        ]
        rows.append((thing, len(best), f"{np.mean(np.array(best) >= 0.5):.2f}", f"{np.mean(best):.2f}"))
    count = np.mean([len(j.probability) for j in judged])
    sure = np.mean([(j.probability >= CONFIDENCE).sum() for j in judged])
    return (
        f"Recorded views of a shelf with label maps ({folder.parent.name}/{folder.name}), {count:.1f} proposals an "
        f"image, {sure:.1f} at p >= {CONFIDENCE:g}:\n\n" + table(("thing", "views", "found", "mean IoU"), rows)
    )


def stage_table(frames: list[Frame]) -> str:
    """Markdown: least milliseconds of CPU of every stage, mean over one frame of each kind."""
    costs: dict[str, list[float]] = {}
    config, detector = ProposalConfig(), ProposalDetector()
    for frame in frames:
        k = frame.intrinsics
        grid = point_grid(frame.depth, k, config.step(frame.depth.shape[1]), config.near, config.far)
        planes = find_planes(grid, k, config.planes)
        clusters = cluster_image(grid, planes, config)
        pieces = pieces_of_things(grid, clusters, config)
        found = describe(grid, pieces, planes, config)
        stages: dict[str, Callable[[], object]] = {
            "points and normals": lambda g=(frame, k, grid.step): point_grid(
                g[0].depth, g[1], g[2], config.near, config.far
            ),
            "planes": lambda g=grid, k=k: find_planes(g, k, config.planes),
            "mean shift": lambda g=grid, p=planes: cluster_image(g, p, config),
            "pieces and joining": lambda g=grid, c=clusters: pieces_of_things(g, c, config),
            "boxes, extents": lambda g=grid, q=pieces, p=planes: describe(g, q, p, config),
            "all proposals": lambda f=frame: find_proposals(f, config),
            "objectness": lambda f=found: shipped_objectness()(proposal_features(f, config)),
            "whole detector, with masks": lambda f=frame: detector(f),
        }
        for name, stage in stages.items():
            costs.setdefault(name, []).append(least_ms(stage, REPEATS))
    size = frames[0].depth.shape
    rows = [(name, f"{np.mean(values):.1f}", f"{max(values):.1f}") for name, values in costs.items()]
    return f"Time at {size[1]} x {size[0]}, one core, ms of CPU:\n\n" + table(("stage", "mean", "most"), rows)


def draw_all(options: argparse.Namespace) -> None:
    """Pictures of a few frames of each sequence to be shown, and of the labelled views."""
    config = ProposalConfig()
    shown: list[tuple[str, Frame]] = []
    for number, line in enumerate(options.show):
        sequence = open_sequence(line)
        frames = [sequence[int(index)] for index in np.linspace(0, len(sequence) - 1, SHOWN)]
        shown += [(f"{number}-{frame.name}", frame) for frame in frames]
    if options.label_fusion:
        shown += [
            (f"labels-{v.frame.name}", v.frame) for v in label_fusion.read_label_fusion(options.label_fusion)[::5]
        ]
    for name, frame in shown:
        picture = proposal_pictures.draw(frame, find_proposals(frame, config), config, CONFIDENCE)
        proposal_pictures.write(options.pictures / f"{name}.png", picture)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=4, help="rendered scenes of each kind")
    parser.add_argument("--label-fusion", type=Path, help="folder of labelled views")
    parser.add_argument("--pictures", type=Path, help="folder to draw into")
    parser.add_argument("--show", action="append", default=[], help="sequence to draw frames of; may be repeated")
    parser.add_argument("--write", action="store_true", help="put the tables into RESULTS.md")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
