"""Scores become probabilities: Platt's sigmoid on objects and backgrounds that no template was learned from.

    p(c | x) = 1 / (1 + exp(u s_c(x) + v))                                                        (Lai et al., eq. 3)

Positives are the best score about every held-out object, as detection takes the best; negatives are the detections on
held-out frames that show no object of the class. How many of the one come with how many of the other is not to be seen
from views of single objects, so it is stated: `TrainConfig.objects_per_frame`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ....datasets.object_views.backgrounds import Background
from ....datasets.object_views.object_view import ObjectView, cut_out
from ...boxes import box_ious
from ...parts import part_box
from ...platt import fit_platt
from ...training.keeping import Kept
from ..model import HogTemplate
from ..pyramid import Pyramid, build_pyramid
from ..scoring import Scorer, part_boxes
from ..suppression import suppress
from .config import TrainConfig
from .mining import FrameWindows
from .placing import in_surroundings
from .rounds import frame_pyramid

FLOOR = -2.0  # least score of a false detection that is looked at: far below, the sigmoid is flat
CANDIDATES = 500  # windows of a frame that suppression chooses from
SUPPRESSION = 0.5  # intersection over union above which the lesser of two windows goes


def calibrated(
    templates: Sequence[HogTemplate],
    classes: Sequence[str],
    views: Kept[ObjectView | None],
    frames: Kept[Background | None],
    config: TrainConfig,
    on_item: Callable[[int], None],
) -> list[HogTemplate]:
    """The templates with Platt's (u, v) of held-out views and frames.

    Args:
        templates: learned ones.
        classes: names by `HogTemplate.class_id`.
        views: held out.
        frames: held out; views with masks are put into them.
        config: the numbers.
        on_item: hears how many views and frames are done.
    """
    hits: list[list[float]] = [[] for _ in templates]
    misses: list[list[np.ndarray]] = [[] for _ in templates]
    for number, view in enumerate(views):
        if view is not None:
            rng = np.random.default_rng([config.seed, 6, number])
            there = cut_out(in_surroundings(view, frames, rng))
            own = [t for t, template in enumerate(templates) if classes[template.class_id] == view.label]
            for t, score in zip(own, _best_scores([templates[t] for t in own], there, config), strict=True):
                if score is not None:
                    hits[t].append(score)
        on_item(number + 1)
    usable = 0
    for number, frame in enumerate(frames):
        if frame is not None:
            usable += 1
            for found, scores in zip(misses, _false_scores(templates, classes, frame, config), strict=True):
                found.append(scores)
        on_item(len(views) + number + 1)
    fits = (
        _fit(np.array(hit), np.concatenate([np.zeros(0), *miss]), usable, config)
        for hit, miss in zip(hits, misses, strict=True)
    )
    return [replace(template, platt=fit) for template, fit in zip(templates, fits, strict=True)]


def _best_scores(templates: Sequence[HogTemplate], view: ObjectView, config: TrainConfig) -> list[float | None]:
    """The best score of every template in windows that show the object; None where no window of the pyramid does."""
    if not templates:
        return []
    pyramid = build_pyramid(view.color, view.depth, view.focal, config.channels, config.pyramid)
    best: list[float | None] = [None] * len(templates)
    for level, scores in zip(pyramid.levels, Scorer(templates).scores(pyramid), strict=True):
        for t, template in enumerate(templates):
            ij = np.argwhere(np.isfinite(scores[t]))
            if len(ij) == 0:
                continue
            overlap = box_ious(part_boxes(template, level, ij), part_box(view.xyxy[None], template.part))[:, 0]
            showing = ij[overlap >= config.found_overlap]
            if len(showing):
                score = float(scores[t, showing[:, 0], showing[:, 1]].max())
                best[t] = score if best[t] is None else max(best[t], score)  # type: ignore[type-var]
    return best


def _false_scores(
    templates: Sequence[HogTemplate], classes: Sequence[str], frame: Background, config: TrainConfig
) -> list[np.ndarray]:
    """For each template the scores of its false detections in a frame, the strongest."""
    pyramid: Pyramid = frame_pyramid(frame, config)
    looking = FrameWindows(templates, frame, pyramid, classes, config.ignored_overlap)
    scores = []
    for t, windows in enumerate(looking.hard(FLOOR)):
        first = windows.select(slice(0, CANDIDATES))
        one_group = np.zeros(len(first.score), dtype=np.int64)
        stay = suppress(looking.boxes(t, first), one_group, SUPPRESSION, config.frame_detections)
        scores.append(first.score[stay].astype(np.float64))
    return scores


def _fit(hits: np.ndarray, misses: np.ndarray, frames: int, config: TrainConfig) -> tuple[float, float]:
    """(u, v) of eq. (3), where every frame shows `objects_per_frame` objects that score as `hits` do.

    Without a negative, or a positive, the SVM's margin is all there is to go by: one made-up example at its border
    stands in.
    """
    hits = hits if len(hits) else np.array([1.0])
    misses = misses if len(misses) else np.array([-1.0])
    weight = config.objects_per_frame * max(frames, 1) / len(hits)
    scores = np.concatenate([hits, misses])
    weights = np.concatenate([np.full(len(hits), weight), np.ones(len(misses))])
    return fit_platt(scores, np.arange(len(scores)) < len(hits), weights)
