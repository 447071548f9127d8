"""What an object looks like through its window: features of every view, as it is and mirrored."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....datasets.object_views.backgrounds import Background
from ....datasets.object_views.object_view import ObjectView, cut_out
from ...training.keeping import Kept
from ..channels import CELL
from ..pyramid import window_features
from .config import TrainConfig
from .placing import in_surroundings
from .windows import ClassWindows, WindowShape

Kind = tuple[str, int]  # a class, and which of its windows


@dataclass(frozen=True, slots=True, eq=False)
class Examples:
    """Windows of whole objects; those of parts are cut from them.

    Attributes:
        features: (N, rows, columns, C) float32.
        scale: (N,) of the pyramid's level on which the window would be found.
        window: (N, 4) pixels, and
        xyxy: (N, 4) pixels, the object's box in the same image.
    """

    features: np.ndarray
    scale: np.ndarray
    window: np.ndarray
    xyxy: np.ndarray

    def __len__(self) -> int:
        return len(self.scale)

    @classmethod
    def joined(cls, several: Sequence[Examples], shape: WindowShape, channels: int) -> Examples:
        """All of them, in order; none at all is fine."""
        none = np.zeros((0, shape.rows, shape.columns, channels), np.float32)
        return cls(
            np.concatenate([none, *(one.features for one in several)]),
            np.concatenate([np.zeros(0), *(one.scale for one in several)]),
            np.concatenate([np.zeros((0, 4)), *(one.window for one in several)]),
            np.concatenate([np.zeros((0, 4)), *(one.xyxy for one in several)]),
        )


def mirrored(view: ObjectView) -> ObjectView:
    """Left and right exchanged, so that the object's left half becomes a right one."""
    width = view.color.shape[1]
    x0, y0, x1, y1 = view.xyxy
    return replace(
        view,
        color=np.ascontiguousarray(view.color[:, ::-1]),
        depth=None if view.depth is None else np.ascontiguousarray(view.depth[:, ::-1]),
        mask=None if view.mask is None else np.ascontiguousarray(view.mask[:, ::-1]),
        xyxy=np.array([width - x1, y0, width - x0, y1]),
    )


def examples_of(view: ObjectView, shape: WindowShape, config: TrainConfig, rng: np.random.Generator) -> list[Examples]:
    """Two examples of a view, as it is and mirrored, each slightly displaced; none where the pyramid has no such level.

    Objects too small for the pyramid's finest level or too large for its coarsest would teach what no detection asks.
    """
    examples = []
    view = cut_out(view)  # not more pixels than needed: missing depth is filled all over them
    for image in (view, mirrored(view)):
        window = jittered(shape.around(image.xyxy), config, rng)
        if not config.pyramid.min_scale <= window_scale(window, shape) <= config.pyramid.max_scale:
            continue
        features, scale = window_features(
            image.color, image.depth, image.focal, window, (shape.rows, shape.columns), config.channels
        )
        examples.append(Examples(features[None], np.array([scale]), window[None], image.xyxy[None]))
    return examples


def jittered(window: np.ndarray, config: TrainConfig, rng: np.random.Generator) -> np.ndarray:
    """The window (4,), displaced and zoomed as the grid of cells and levels would."""
    size = window[2:] - window[:2]
    center = 0.5 * (window[:2] + window[2:]) + rng.uniform(-config.shift, config.shift, 2) * size
    half = 0.5 * size * 2.0 ** rng.uniform(-config.zoom, config.zoom)
    return np.concatenate([center - half, center + half])


def window_scale(window: np.ndarray, shape: WindowShape) -> float:
    """Scale of the level on which a window (4,) of the shape's aspect has its cells."""
    return CELL * shape.columns / float(window[2] - window[0])


def collect_examples(
    views: Kept[ObjectView | None],
    labels: Sequence[str | None],
    windows: dict[str, ClassWindows],
    backgrounds: Kept[Background | None],
    config: TrainConfig,
    on_view: Callable[[int], None],
) -> tuple[dict[Kind, Examples], dict[Kind, Examples]]:
    """Positives of every class and window, and objects of the other classes seen through the window.

    The latter are each class's first negatives, as Lai et al. have them (III-C); they are not mirrored. `labels`
    are the views' classes, None for one that cannot be used.
    """
    chosen = _other_views(labels, tuple(windows), config)
    shapes = {(label, k): shape for label, its in windows.items() for k, shape in enumerate(its.shapes)}
    own: dict[Kind, list[Examples]] = {kind: [] for kind in shapes}
    other: dict[Kind, list[Examples]] = {kind: [] for kind in shapes}
    for number, view in enumerate(views):
        if view is not None:
            rng = np.random.default_rng([config.seed, 2, number])
            there = in_surroundings(view, backgrounds, rng)
            kind = view.label, int(windows[view.label].number(view.xyxy[None])[0])
            own[kind] += examples_of(there, shapes[kind], config, rng)
            for label in chosen.get(number, ()):
                for k, shape in enumerate(windows[label].shapes):
                    other[label, k] += examples_of(there, shape, config, rng)[:1]
        on_view(number + 1)
    count = config.channels.count
    return (
        {kind: Examples.joined(own[kind], shape, count) for kind, shape in shapes.items()},
        {kind: Examples.joined(other[kind], shape, count) for kind, shape in shapes.items()},
    )


def _other_views(labels: Sequence[str | None], classes: Sequence[str], config: TrainConfig) -> dict[int, list[str]]:
    """Number of a view -> the classes that take it as a negative."""
    chosen: dict[int, list[str]] = {}
    for place, label in enumerate(classes):
        strangers = [number for number, its in enumerate(labels) if its is not None and its != label]
        rng = np.random.default_rng([config.seed, 3, place])
        count = min(config.other_views, len(strangers))
        for k in rng.choice(len(strangers), count, replace=False) if count else ():
            chosen.setdefault(strangers[k], []).append(label)
    return chosen
