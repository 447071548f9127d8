"""How long the shape-context detector takes for a frame of 640 x 480 with five classes, stage by stage, on one core.

Times are of CPU, in a process of one thread: on a core that nobody else uses they are those of a clock.

uv run python benchmarks/shape_context_speed.py                                   the shipped model, rendered tabletops
uv run python benchmarks/shape_context_speed.py --sequence ../shared/data/redkitchen --model FILE.npz
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numba
import numpy as np
from results import show_section, table
from timing import least_ms

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame
from thingmap.datasets.open import open_sequence
from thingmap.detectors.proposals.config import ProposalConfig
from thingmap.detectors.proposals.objectness import proposal_features, shipped_objectness
from thingmap.detectors.proposals.proposals import Proposals, find_proposals
from thingmap.detectors.shape_context.calibration import Calibration
from thingmap.detectors.shape_context.config import Context
from thingmap.detectors.shape_context.described import Described
from thingmap.detectors.shape_context.described import describe as describe_points
from thingmap.detectors.shape_context.detector import ShapeContextDetector
from thingmap.detectors.shape_context.edges import find_edges
from thingmap.detectors.shape_context.local_turn import local_turn
from thingmap.detectors.shape_context.model import ShapeContextModel, load_model, shipped_model
from thingmap.detectors.shape_context.sampling import edge_owners
from thingmap.detectors.shape_context.scoring import score_proposals

TITLE = "Shape-context detector, speed"
SCENES = ("synth:tabletop?seed=7&clutter=low", "synth:tabletop?seed=7&clutter=high")
FRAMES = 5  # of each sequence
CLASSES = ("bowl", "cap", "cereal box", "coffee mug", "soda can")  # the paper's of the second dataset
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
WHOLE, PROPOSALS, REST = "whole detector", "proposals and objectness", "votes, hypotheses, verification"
LIMITS = {PROPOSALS: 60.0, WHOLE: 500.0}  # ms

Times = dict[str, list[float]]  # stage -> ms of each frame


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure in a process of one thread, print, and write if asked to; 2 for a user's mistake."""
    options = _options(arguments)
    os.environ.update(dict.fromkeys(THREADS, "1"))  # read by libraries as the new process loads them
    try:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            text = pool.apply(measure, (options.sequence or list(SCENES), options.model, options.repeats))
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    show_section(TITLE, text, options.write)
    return 0


def measure(sequences: Sequence[str], model: Path, repeats: int) -> str:
    """Markdown: the median over frames of every stage; of each frame the least of so many repeats.

    Raises:
        UserError: a sequence or the model cannot be read.
    """
    numba.set_num_threads(1)
    cv2.setNumThreads(1)
    detector = ShapeContextDetector(of_classes(load_model(model), CLASSES))
    times: Times = {}
    samples, size = [], (0, 0)
    for line in sequences:
        sequence = open_sequence(line)
        for index in np.linspace(0, len(sequence) - 1, FRAMES + 2)[1:-1].astype(int):
            frame = sequence[int(index)]
            size = frame.color.shape[1], frame.color.shape[0]
            samples.append(time_stages(detector, frame, times, repeats))
    return describe(detector.model, times, size, float(np.median(samples)))


def of_classes(model: ShapeContextModel, classes: Sequence[str]) -> ShapeContextModel:
    """The model of some of its classes.

    Raises:
        UserError: it lacks one.
    """
    missing = sorted(set(classes) - set(model.classes))
    if missing:
        raise UserError(f"expected a model that knows {', '.join(classes)}, but it lacks {', '.join(missing)}")
    rows = [model.classes.index(label) for label in classes]
    books = tuple(model.codebooks[row] for row in rows)
    rivals = {book.radius: model.rivals[book.radius] for book in books} if model.rivals else {}
    calibration = Calibration(model.calibration.weights[rows], model.calibration.offset[rows])
    return replace(model, classes=tuple(classes), codebooks=books, rivals=rivals, calibration=calibration)


def time_stages(detector: ShapeContextDetector, frame: Frame, times: Times, repeats: int) -> int:
    """Adds the least milliseconds of every stage, in the detector's order; returns how many points are described."""
    config, books, focal = detector.voting, detector.model.codebooks, frame.intrinsics.fx

    def proposals() -> tuple[Proposals, np.ndarray]:
        found = find_proposals(frame)
        return found, shipped_objectness()(proposal_features(found, ProposalConfig())) >= config.min_objectness

    found, looked_at = proposals()
    labels = np.where(np.append(looked_at, False)[found.labels], found.labels, np.int32(-1))
    within = labels >= 0 if config.context is Context.PROPOSAL else None
    edges = find_edges(frame.color, frame.depth, within=within)
    owner = edge_owners(edges, labels, frame.depth)
    turn = local_turn(edges, frame.intrinsics, found.planes.up)
    described, rivals = describe_points(edges, owner, focal, config, turn), detector.model.rivals

    def contexts() -> None:
        fresh = Described(edges, owner, focal, described.samples, described.voters, config)  # they are kept once made
        for book in books:
            fresh.contexts(book.radius, book.depth)

    def matching() -> None:
        for book in books:
            described.matches(book.descriptors, book, config.matches)

    def rival_matching() -> None:
        for book in {book.radius: book for book in books if rivals}.values():
            described.matches(rivals[book.radius], book, config.matches)

    matching()  # has the contexts made
    stages: dict[str, Callable[[], object]] = {
        PROPOSALS: proposals,
        "edges": lambda: find_edges(frame.color, frame.depth, within=within),
        "owners and samples": lambda: describe_points(
            edges,
            edge_owners(edges, labels, frame.depth),
            focal,
            config,
            local_turn(edges, frame.intrinsics, found.planes.up),
        ),
        "descriptors": contexts,
        "matching": matching,
        "matching of rivals": rival_matching,
    }
    rest = {"scores": lambda: score_proposals(described, labels, found.xyxy, books, config, rivals)}
    costs = {name: least_ms(work, repeats) for name, work in (stages | rest | {WHOLE: lambda: detector(frame)}).items()}
    # votes to verification have no call of their own: what is left of the scores
    inner = costs["matching"] + costs["matching of rivals"]
    costs[REST] = max(costs.pop("scores") - inner, 0.0)
    for name in (*stages, REST, WHOLE):
        times.setdefault(name, []).append(costs[name])
    return len(described.samples.points)


def describe(model: ShapeContextModel, times: Times, size: tuple[int, int], samples: float) -> str:
    """Markdown: every stage, and the limits."""
    rows = [(name, f"{np.median(ms):.1f}", f"{max(ms):.1f}") for name, ms in times.items()]
    said = []
    for name, limit in LIMITS.items():
        median = float(np.median(times[name]))
        kept = "within" if median <= limit else "NOT within"
        said.append(f"{name}: {median:.0f} ms, {kept} the limit of {limit:g} ms")
    entries, radii = sum(map(len, model.codebooks)), len({book.radius for book in model.codebooks})
    return (
        f"{size[0]} x {size[1]}, {len(times[WHOLE])} frames, one thread; {len(model.classes)} classes, {entries} "
        f"entries, {radii} radii, {samples:.0f} described points (median).\n\n"
        + table(("stage", "ms of CPU, median", "most"), rows)
        + "\n\n"
        + "; ".join(said)
        + ". Owners and samples, and what the stages pass on, are in the whole too."
    )


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--sequence", action="append", metavar="SEQUENCE", help="instead of rendered tabletops; may be repeated")
    add("--model", type=Path, default=shipped_model(), metavar="FILE", help="instead of the shipped one")
    add("--repeats", type=int, default=5, metavar="N", help="of every measurement, of which the least counts")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.repeats < 1:
        parser.error("--repeats counts from 1")
    return options


if __name__ == "__main__":
    sys.exit(main())
