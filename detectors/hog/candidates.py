"""Windows with their scores, and those that are probable enough to be looked at again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from scipy.special import logit

from ..boxes import areas, cut_to_image
from ..detections import Part
from .channels import CELL
from .pyramid import Level, Pyramid
from .scoring import Scorer, part_boxes
from .suppression import suppress

if TYPE_CHECKING:
    from .model import HogTemplate


@dataclass(frozen=True, slots=True, eq=False)
class ScoredLevel:
    """The scores of all windows of one level of a pyramid, and where these are in the image.

    Attributes:
        scores: (T, h, w) float32 of T templates; -inf where a template does not fit, which is in its last rows and
            columns.
        first: (T, 4) pixels, box that a template's window at (0, 0) stands for; it may lie outside the image.
        step: pixels from a window to the next, in both directions: that of (i, j) has the box
            `first + step * (j, i, j, i)`.
    """

    scores: np.ndarray
    first: np.ndarray
    step: float

    @classmethod
    def of(cls, level: Level, scores: np.ndarray, corner: np.ndarray) -> ScoredLevel:
        """From what `Scorer.scores` gave for a level of a pyramid, and the `corner_boxes` of the same templates."""
        first = (corner - CELL * level.border) / level.scale
        return cls(np.ascontiguousarray(scores, dtype=np.float32), first, CELL / level.scale)


def corner_boxes(templates: Sequence[HogTemplate]) -> np.ndarray:
    """(T, 4) pixels, what the window in the corner of an image at its own size stands for, of every template."""
    plain = Level(1.0, np.zeros((0, 0, 0), dtype=np.float32), 0)
    found = [part_boxes(template, plain, np.zeros((1, 2)))[0] for template in templates]
    return np.array(found, dtype=np.float64).reshape(-1, 4)


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """N windows, the most probable first.

    Attributes:
        class_id: (N,) of the template.
        part: (N,) `Part` of the template.
        xyxy: (N, 4) pixels, the box the window stands for; not clipped to the image.
        probability: (N,) calibrated score (eq. 3).
    """

    class_id: np.ndarray
    part: np.ndarray
    xyxy: np.ndarray
    probability: np.ndarray

    def __len__(self) -> int:
        return len(self.xyxy)

    def select(self, index: np.ndarray) -> Candidates:
        """Those that a boolean mask or indices name, in that order."""
        return Candidates(self.class_id[index], self.part[index], self.xyxy[index], self.probability[index])

    def joined(self, other: Candidates) -> Candidates:
        """These and others."""
        pairs = [(getattr(self, one.name), getattr(other, one.name)) for one in fields(self)]
        joined = Candidates(*(np.concatenate(pair) for pair in pairs))
        return joined.select(np.argsort(-joined.probability, kind="stable"))


def candidates(
    levels: Sequence[ScoredLevel], templates: Sequence[HogTemplate], least: float, parts: Sequence[Part] = tuple(Part)
) -> Candidates:
    """Windows of some parts' templates, of at least a probability `least`; of equal ones, those of finer levels and
    earlier templates first."""
    lowest = np.array(
        [_score_of(least, *template.platt) if template.part in parts else np.inf for template in templates],
        dtype=np.float32,
    )
    found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for level in levels:
        t, i, j = np.unravel_index(np.flatnonzero(level.scores >= lowest[:, None, None]), level.scores.shape)
        shift = level.step * np.stack([j, i, j, i], axis=1)
        found.append((t, level.first[t] + shift, level.scores[t, i, j].astype(np.float64)))
    t = np.concatenate([np.zeros(0, dtype=np.int64), *(part[0] for part in found)])
    xyxy = np.concatenate([np.zeros((0, 4)), *(part[1] for part in found)])
    score = np.concatenate([np.zeros(0), *(part[2] for part in found)])
    probability = np.zeros(len(t))
    for index, template in enumerate(templates):
        own = t == index
        probability[own] = template.probability(score[own])
    class_id = np.array([template.class_id for template in templates], dtype=np.int64)[t]
    part = np.array([template.part for template in templates], dtype=np.int8)[t]
    return Candidates(class_id, part, xyxy, probability).select(np.argsort(-probability, kind="stable"))


def scored_levels(pyramid: Pyramid, scorer: Scorer, corner: np.ndarray) -> list[ScoredLevel]:
    """The scores of all windows of a pyramid; `corner` are the `corner_boxes` of the scorer's templates."""
    pairs = zip(pyramid.levels, scorer.scores(pyramid), strict=True)
    return [ScoredLevel.of(level, scores, corner) for level, scores in pairs]


def without_lesser(found: Candidates, width: int, height: int, nms_iou: float, most: int) -> Candidates:
    """The windows that are left when those of the same class and part have suppressed each other, in the image of that
    size; their boxes are not cut to it."""
    boxes = cut_to_image(found.xyxy, width, height)
    inside = np.flatnonzero(areas(boxes) > 0.0)
    group = found.class_id * len(Part) + found.part
    return found.select(inside[suppress(boxes[inside], group[inside], nms_iou, most)])


def _score_of(probability: float, u: float, v: float) -> float:
    """Lowest score of a probability, the inverse of eq. (3); beyond all others where any score or none will do."""
    most = float(np.finfo(np.float32).max)  # not infinity: -inf is the score of windows that do not exist
    log_odds = float(logit(probability))
    if u == 0.0:
        return -most if -v >= log_odds else most
    return float(np.clip((-log_odds - v) / u, -most, most))


@njit(cache=True)
def windows_that_fit(scores: np.ndarray) -> tuple[int, int]:
    """Rows and columns of the windows of a template that fit into a level: the finite ones of its (h, w) scores."""
    rows = columns = 0
    while rows < scores.shape[0] and scores.shape[1] > 0 and scores[rows, 0] > -np.inf:
        rows += 1
    while columns < scores.shape[1] and scores.shape[0] > 0 and scores[0, columns] > -np.inf:
        columns += 1
    return rows, columns
