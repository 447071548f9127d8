"""Edges of depth and of colour against the true outlines of rendered things, and what they cost.

uv run python benchmarks/edges.py --write
uv run python benchmarks/edges.py --scenes 0 --pictures OUT --show synth:tabletop --show ../shared/data/redkitchen

Recall is the share of the things' outlines that has a point within 3 pixels; precision the share of points, of those on
and around things, that are as near to an outline. Prints on things are no outlines here, though votes may use them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from results import show_section, table
from timing import least_ms

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame
from thingmap.datasets.open import open_sequence
from thingmap.datasets.synthetic.synth import open_synth
from thingmap.detectors.shape_context.boundaries import color_boundaries
from thingmap.detectors.shape_context.depth_edges import depth_edges, inverse_depth
from thingmap.detectors.shape_context.edge_config import BoundaryConfig, EdgeConfig
from thingmap.detectors.shape_context.edge_map import EdgeMap
from thingmap.detectors.shape_context.edges import find_edges

TITLE = "Edges"
KINDS = (
    "tabletop?clutter=low",
    "tabletop?clutter=medium",
    "tabletop?clutter=high",
    "survey?clutter=medium",
    "kitchen?clutter=medium",
)
NEAR = 3  # pixels between a point and an outline that agree
AROUND = 5  # pixels around things whose points count for precision
HIGH = (8.0, 15.0, 25.0)  # CIE Lab, thresholds of colour to compare
CANNY = ((60, 150), (100, 250))
REPEATS = 7
SHOWN = 3
DEPTH_TINT, COLOR_TINT = (255, 80, 60), (90, 230, 255)  # RGB


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, draw, and write if asked to; 2 for a user's mistake."""
    options = _options(arguments)
    try:
        if options.scenes:
            text = measure(options)
            show_section(TITLE, text, options.write)
        if options.pictures:
            draw_all(options)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def measure(options: argparse.Namespace) -> str:
    """Markdown of both tables."""
    scores: dict[str, list[tuple[float, ...]]] = {}
    frames: dict[str, Frame] = {}
    for kind, frame, instances in rendered(options):
        frames.setdefault(kind, frame)
        for name, is_edge in ways(frame):
            scores.setdefault(name, []).append(agreement(is_edge, instances))
    rows = [(name, *_row(np.nanmean(values, axis=0))) for name, values in scores.items()]
    count = len(next(iter(scores.values())))
    last = options.first_seed + options.scenes - 1
    return (
        f"{count} images of rendered scenes, seeds {options.first_seed} to {last}, of {', '.join(KINDS)}. Agreement "
        f"within {NEAR} pixels; precision of points on things and up to {AROUND} pixels around them.\n\n"
        + table(("edges", "recall", "precision", "F", "points on things", "elsewhere"), rows)
        + f"\n\nTime, one thread, ms of CPU, over {len(frames)} of these images:\n\n"
        + table(("stage", "mean", "most"), stage_rows(list(frames.values())))
    )


def rendered(options: argparse.Namespace) -> Iterator[tuple[str, Frame, np.ndarray]]:
    """Kind of scene, frame, and its (H, W) thing of every pixel; images that show things."""
    for kind in KINDS:
        for seed in range(options.first_seed, options.first_seed + options.scenes):
            sequence = open_synth(f"{kind}&seed={seed}")
            for index in np.linspace(0, len(sequence) - 1, options.frames + 2)[1:-1].astype(int).tolist():
                instances = sequence.instances(index)
                if outlines(instances).any():
                    yield kind, sequence[index], instances
            print(f"{kind}&seed={seed}", file=sys.stderr, flush=True)


def ways(frame: Frame) -> Iterator[tuple[str, np.ndarray]]:
    """Name and (H, W) bool of every way to find edges."""
    config = EdgeConfig()
    yield "depth", depth_edges(frame.depth, config.depth)[0]
    gray = cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY)
    for low, high in CANNY:
        yield f"cv2.Canny of gray, {low}/{high}", cv2.Canny(gray, low, high) > 0
    one = replace(config.boundaries, radii=config.boundaries.radii[:1])
    yield "colour, finest radius alone", color_boundaries(frame.color, one)[0]
    for high in HIGH:
        boundaries = _thresholds(config.boundaries, high)
        yield f"colour, high {high:g}", color_boundaries(frame.color, boundaries)[0]
    for high in HIGH:
        edges = find_edges(frame.color, frame.depth, replace(config, boundaries=_thresholds(config.boundaries, high)))
        yield f"depth and colour, high {high:g}", _image(edges)


def _thresholds(config: BoundaryConfig, high: float) -> BoundaryConfig:
    return replace(config, high=high, low=high * config.low / config.high)


def _image(edges: EdgeMap) -> np.ndarray:
    image = np.zeros(edges.shape, bool)
    image[edges.rows, edges.columns] = True
    return image


def outlines(instances: np.ndarray) -> np.ndarray:
    """(H, W) bool: pixels beside one of another thing, or of none."""
    out = np.zeros(instances.shape, bool)
    beside, below = instances[:, 1:] != instances[:, :-1], instances[1:] != instances[:-1]
    out[:, 1:] |= beside
    out[:, :-1] |= beside
    out[1:] |= below
    out[:-1] |= below
    return out


def agreement(is_edge: np.ndarray, instances: np.ndarray) -> tuple[float, float, float, float]:
    """Recall, precision (NaN without points), points on and around things, points elsewhere."""
    true = outlines(instances)
    window = np.ones((2 * AROUND + 1, 2 * AROUND + 1), np.uint8)
    around = cv2.dilate((instances >= 0).astype(np.uint8), window) > 0
    on_things = is_edge & around
    recall = np.mean(_away(is_edge)[true] <= NEAR)
    precision = np.mean(_away(true)[on_things] <= NEAR) if on_things.any() else np.nan
    return float(recall), float(precision), float(on_things.sum()), float((is_edge & ~around).sum())


def _away(points: np.ndarray) -> np.ndarray:
    """(H, W) pixels to the nearest point."""
    return cv2.distanceTransform((~points).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def _row(mean: np.ndarray) -> tuple[str, ...]:
    recall, precision, on_things, elsewhere = mean.tolist()
    f = 2 * recall * precision / (recall + precision)
    return f"{recall:.3f}", f"{precision:.3f}", f"{f:.3f}", f"{on_things:.0f}", f"{elsewhere:.0f}"


def stage_rows(frames: list[Frame]) -> list[tuple[str, str, str]]:
    """Least milliseconds of CPU of every stage; mean and most over frames."""
    cv2.setNumThreads(1)
    costs: dict[str, list[float]] = {}
    for frame in frames:
        inverse = inverse_depth(frame.depth)
        middle = np.zeros(frame.depth.shape, bool)
        middle[frame.depth.shape[0] // 4 : -frame.depth.shape[0] // 4, frame.depth.shape[1] // 4 :] = True
        middle[:, -frame.depth.shape[1] // 4 :] = False
        stages: dict[str, Callable[[], object]] = {
            "filling holes": lambda f=frame: inverse_depth(f.depth),
            "edges of depth": lambda f=frame, i=inverse: depth_edges(f.depth, inverse=i),
            "boundaries of colour": lambda f=frame: color_boundaries(f.color),
            "all": lambda f=frame: find_edges(f.color, f.depth),
            "all, within the middle quarter": lambda f=frame, m=middle: find_edges(f.color, f.depth, within=m),
            "cv2.Canny of gray, for comparison": lambda f=frame: cv2.Canny(
                cv2.cvtColor(f.color, cv2.COLOR_RGB2GRAY), *CANNY[0]
            ),
        }
        for name, stage in stages.items():
            costs.setdefault(name, []).append(least_ms(stage, REPEATS))
    return [(name, f"{np.mean(values):.1f}", f"{max(values):.1f}") for name, values in costs.items()]


def draw_all(options: argparse.Namespace) -> None:
    """Pictures of a few frames of each sequence to be shown."""
    options.pictures.mkdir(parents=True, exist_ok=True)
    for number, line in enumerate(options.show or [f"synth:{KINDS[1]}&seed={options.first_seed}"]):
        sequence = open_sequence(line)
        for index in sorted({int(i) for i in np.linspace(0, len(sequence) - 1, SHOWN)}):
            frame = sequence[index]
            picture = np.hstack([frame.color, drawn(frame.color, find_edges(frame.color, frame.depth))])
            cv2.imwrite(str(options.pictures / f"edges-{number}-{frame.name}.png"), picture[..., ::-1])


def drawn(color: np.ndarray, edges: EdgeMap) -> np.ndarray:
    """(H, W, 3) uint8: the image darkened, edges of depth in red, of colour alone in light blue."""
    picture = color // 3
    for kind, tint in ((edges.is_depth, DEPTH_TINT), (~edges.is_depth, COLOR_TINT)):
        picture[edges.rows[kind], edges.columns[kind]] = tint
    return picture


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=2, help="rendered scenes of each kind")
    parser.add_argument("--frames", type=int, default=3, help="images of each scene")
    parser.add_argument("--first-seed", type=int, default=1, help="thresholds were tried on seeds below 1000")
    parser.add_argument("--pictures", type=Path, help="folder to draw into")
    parser.add_argument("--show", action="append", default=[], help="sequence to draw frames of; may be repeated")
    parser.add_argument("--write", action="store_true", help="put the tables into RESULTS.md")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
