"""How long the HOG detector takes for a frame, part by part, and how its pyramid's steps and sizes change that.

uv run python benchmarks/hog_speed.py                                  a rendered tabletop, random templates
uv run python benchmarks/hog_speed.py --sequence ../shared/data/redkitchen --model model.npz
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from results import show_section, table

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame
from thingmap.datasets.open import open_sequence
from thingmap.detectors.detections import Part
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.config import PyramidConfig
from thingmap.detectors.hog.depth_fill import filled
from thingmap.detectors.hog.detector import HogDetector
from thingmap.detectors.hog.model import HogModel, HogTemplate, load_model
from thingmap.detectors.hog.pyramid import Pyramid, build_pyramid
from thingmap.detectors.hog.scoring import Scorer
from thingmap.mapper.evaluation.reporting.report import without_folders

TITLE = "HOG detector, speed"
SCENE = "synth:tabletop?seed=7&clutter=high"
CLASSES, CELLS = 6, 8
PAPER = 4000.0  # ms a frame; 1800 each for features and for sliding windows (Lai et al. 2012, section IV-B)
PAPER_PART = 1800.0
LIMIT = 20.0  # times as fast as the paper
AIM = 100.0  # ms
PASSING = 1e-3  # share of windows that random templates let through, for what follows to have work
STEPS, LARGEST, WINDOWS = (3, 4, 5), (1.0, 2.0**0.5, 2.0), (6, 8)


@dataclass(frozen=True, slots=True)
class Cost:
    """Milliseconds: median and least on the wall, and median of CPU."""

    median: float
    least: float
    cpu: float


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write if asked to; 2 for a user's mistake."""
    options = _options(arguments)
    try:
        sequence = open_sequence(options.sequence)
        frame = sequence[len(sequence) // 2]
        model = load_model(options.model) if options.model else random_model(frame, CELLS, PyramidConfig())
        memory = memory_of_first_frame(model, options.sequence)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    described = options.model.name if options.model else f"random templates of about {CELLS} x {CELLS} cells"
    text = describe(without_folders(options.sequence), frame, described, model, memory, options.repeats)
    show_section(TITLE, text + "\n\n" + compare_pyramids(frame, options.repeats), options.write)
    return 0


def memory_of_first_frame(model: HogModel, sequence: str) -> float:
    """MB by which a new process grows at its peak with the first whole frame; 0 where the system does not tell."""
    if not Path("/proc/self/clear_refs").exists():
        return 0.0
    with tempfile.TemporaryDirectory() as folder, multiprocessing.get_context("spawn").Pool(1) as pool:
        path = Path(folder) / "model.npz"
        model.save(path)
        return pool.apply(_memory_here, (path, sequence))


def _memory_here(model: Path, name: str) -> float:
    sequence = open_sequence(name)
    frame, detector = sequence[len(sequence) // 2], HogDetector(model)
    small = replace(frame.intrinsics, width=96, height=96)
    detector(replace(frame, color=frame.color[:96, :96], depth=frame.depth[:96, :96], intrinsics=small))
    Path("/proc/self/clear_refs").write_text("5")  # what loading and compiling took does not count as peak
    before = _memory("VmRSS")
    detector(frame)
    return _memory("VmHWM") - before


def random_model(frame: Frame, cells: int, pyramid: PyramidConfig) -> HogModel:
    """Templates of whole objects and of halves, of which a few windows of the frame pass."""
    rng = np.random.default_rng(3)
    half = cells // 2
    shapes = {
        Part.WHOLE: (cells, cells),
        Part.TOP: (half, cells),
        Part.BOTTOM: (half, cells),
        Part.LEFT: (cells, half),
        Part.RIGHT: (cells, half),
    }
    count = Channels.RGBD.count
    templates = [
        HogTemplate(k, part, rng.normal(size=(*shape, count)), 0.1, 0.0, (-1.0, 0.0), (0.0, 0.0, 1.0, 1.0))
        for k in range(CLASSES)
        for part, shape in shapes.items()
    ]
    features = build_pyramid(frame.color, frame.depth, frame.intrinsics.fx, Channels.RGBD, pyramid)
    levels = Scorer(templates).scores(features)
    passing = [np.quantile(np.concatenate([s[t][s[t] > -np.inf] for s in levels]), 1 - PASSING) for t in range(30)]
    templates = [replace(t, bias=-float(least)) for t, least in zip(templates, passing, strict=True)]
    return HogModel(tuple(f"class {k}" for k in range(CLASSES)), Channels.RGBD, tuple(templates), pyramid, {})


def describe(name: str, frame: Frame, model_name: str, model: HogModel, memory: float, repeats: int) -> str:
    """Markdown: every part of the work on one frame, beside the paper's."""
    detector, scorer = HogDetector(model), Scorer(model.templates)
    pyramid = _pyramid(frame, model.channels, model.pyramid)
    found = detector(frame)
    costs = {
        "features": (_cost(lambda: _pyramid(frame, model.channels, model.pyramid), repeats), PAPER_PART),
        "(filling depth)": (_cost(lambda: filled(frame.depth), repeats), None),
        "scores of all windows": (_cost(lambda: scorer.scores(pyramid), repeats), PAPER_PART),
        "whole detector": (_cost(lambda: detector(frame), repeats), PAPER),
        "with probability maps": (_cost(lambda: detector.detect_dense(frame), repeats), PAPER),
    }
    rows = [
        (part, f"{c.median:.1f}", f"{c.least:.1f}", f"{c.cpu:.1f}", f"{paper / c.median:.0f}" if paper else "")
        for part, (c, paper) in costs.items()
    ]
    whole = costs["whole detector"][0].median
    sizes = _bytes(pyramid), sum(s.nbytes for s in scorer.scores(pyramid))
    return (
        f"`{name}`, {frame.color.shape[1]} x {frame.color.shape[0]}, {100 * np.mean(frame.depth <= 0):.0f} % of the "
        f"depth missing; {model_name}: {len(model.classes)} classes, {len(model.templates)} templates, "
        f"{model.channels.value}; {len(pyramid.levels)} levels of {_cells(pyramid)} cells; {len(found)} detections.\n\n"
        + table(("part", "ms", "least ms", "ms of CPU", "times the paper's speed"), rows)
        + f"\n\nMemory: features {sizes[0] / 1e6:.1f} MB, scores {sizes[1] / 1e6:.1f} MB; the process's peak grew by "
        f"{memory:.0f} MB with the first frame. The paper's is single-threaded MATLAB of 2012: the detector "
        f"{'keeps' if PAPER / whole >= LIMIT else 'does NOT keep'} its limit of {LIMIT:g} times that speed, and "
        f"{'reaches' if whole <= AIM else 'does NOT reach'} its aim of {AIM:g} ms."
    )


def compare_pyramids(frame: Frame, repeats: int) -> str:
    """Markdown: features and scores by the pyramid's steps and first scale and the windows' size."""
    rows = []
    models = {cells: random_model(frame, cells, PyramidConfig()) for cells in WINDOWS}
    for steps in STEPS:
        for largest in LARGEST:
            config = PyramidConfig(levels_per_octave=steps, max_scale=largest)
            pyramid = _pyramid(frame, Channels.RGBD, config)
            costs = [_cost(lambda c=config: _pyramid(frame, Channels.RGBD, c), repeats)]
            for model in models.values():
                scorer = Scorer(model.templates)
                costs.append(_cost(lambda s=scorer, p=pyramid: s.scores(p), repeats))
            smallest = [f"{cells * 8 / largest:.0f}" for cells in WINDOWS]
            times = [f"{cost.median:.0f} / {cost.cpu:.0f}" for cost in costs]
            sizes = len(pyramid.levels), _cells(pyramid), f"{_bytes(pyramid) / 1e6:.1f}"
            rows.append((steps, f"{largest:.2f}", *sizes, " / ".join(smallest), *times))
    head = ("levels an octave", "largest scale", "levels", "cells", "MB", "smallest window, px", "features")
    head += tuple(f"scores, {cells} x {cells}" for cells in WINDOWS)
    used = PyramidConfig()
    return (
        f"Other pyramids, {CLASSES} classes x {len(Part)} templates, median ms on the wall / of CPU in both "
        f"threads; the default is {used.levels_per_octave} levels from {used.max_scale:.2f}:\n\n" + table(head, rows)
    )


def _pyramid(frame: Frame, channels: Channels, config: PyramidConfig) -> Pyramid:
    return build_pyramid(frame.color, frame.depth, frame.intrinsics.fx, channels, config)


def _cost(work: Callable[[], object], repeats: int) -> Cost:
    work()
    wall, cpu = [], []
    for _ in range(repeats):
        started, started_cpu = time.perf_counter(), time.process_time()
        work()
        wall.append(1e3 * (time.perf_counter() - started))
        cpu.append(1e3 * (time.process_time() - started_cpu))
    return Cost(float(np.median(wall)), min(wall), float(np.median(cpu)))


def _cells(pyramid: Pyramid) -> int:
    return sum(level.features.shape[0] * level.features.shape[1] for level in pyramid.levels)


def _bytes(pyramid: Pyramid) -> int:
    return sum(level.features.nbytes for level in pyramid.levels)


def _memory(kind: str) -> float:
    """MB of this process, by a line of Linux's /proc."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(float(line.split()[1]) / 1e3 for line in lines if line.startswith(kind))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--sequence", default=SCENE, metavar="SEQUENCE", help=f"whose middle frame is used (default {SCENE})")
    add("--model", type=Path, metavar="FILE", help="a trained model instead of random templates")
    add("--repeats", type=int, default=15, metavar="N", help="of every measurement, for the median (default 15)")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.repeats < 1:
        parser.error("--repeats counts from 1")
    return options


if __name__ == "__main__":
    sys.exit(main())
