"""The windows of a frame that templates take for their objects: false positives, the harder the higher the score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from ....datasets.object_views.backgrounds import Background
from ...boxes import box_ious
from ...parts import part_box
from ..model import HogTemplate
from ..pyramid import Pyramid
from ..scoring import Scorer, part_boxes


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """N windows of one template in one frame.

    Attributes:
        place: (N, 3) int32 level, row and column of the window's first cell, border included.
        score: (N,) float32.
    """

    place: np.ndarray
    score: np.ndarray

    def select(self, index: np.ndarray | slice) -> Windows:
        """Those that a mask, a slice or indices name, in that order."""
        return Windows(self.place[index], self.score[index])


class FrameWindows:
    """The windows of all templates in one frame.

    Args:
        templates: T of them.
        frame: knows its true objects.
        pyramid: of the frame.
        classes: names by `HogTemplate.class_id`.
        ignored_overlap: intersection over union with a true object of the class (its half, for a half template) from
            which a window is left out: it shows the object.
    """

    def __init__(
        self,
        templates: Sequence[HogTemplate],
        frame: Background,
        pyramid: Pyramid,
        classes: Sequence[str],
        ignored_overlap: float,
    ) -> None:
        self._templates, self._frame, self._pyramid = templates, frame, pyramid
        self._classes, self._ignored_overlap = classes, ignored_overlap
        self._scorer = Scorer(templates)

    def hard(self, floor: float) -> list[Windows]:
        """For each template, its false windows above `floor`, the highest score first.

        Of a window and those one cell beside it only the highest is taken: they show the same.
        """
        found: list[list[Windows]] = [[] for _ in self._templates]
        for number, scores in enumerate(self._scorer.scores(self._pyramid)):
            owner, row, column = _peaks(scores, floor)
            place = np.stack([np.full(len(owner), number), row, column], axis=1).astype(np.int32)
            windows = Windows(place, scores[owner, row, column])
            bounds = np.searchsorted(owner, np.arange(len(self._templates) + 1))
            for t, (start, stop) in enumerate(pairwise(bounds)):
                if stop > start:
                    found[t].append(windows.select(slice(start, stop)))
        return [self._false(t, _by_score(parts)) for t, parts in enumerate(found)]

    def random(self, count: int, rng: np.random.Generator) -> list[Windows]:
        """For each template up to `count` of its false windows, any; the score is 0."""
        return [self._false(t, self._drawn(template, count, rng)) for t, template in enumerate(self._templates)]

    def _drawn(self, template: HogTemplate, count: int, rng: np.random.Generator) -> Windows:
        rows, columns, _ = template.weights.shape
        size = np.array([level.features.shape[:2] for level in self._pyramid.levels]).reshape(-1, 2)
        fits = np.maximum(size - [rows - 1, columns - 1], 0)
        ends = np.cumsum(fits.prod(axis=1))
        total = int(ends[-1]) if len(ends) else 0
        chosen = np.sort(rng.choice(total, min(count, total), replace=False)) if total else np.zeros(0, np.int64)
        level = np.searchsorted(ends, chosen, side="right")
        inside = chosen - np.append(0, ends)[level]
        width = np.append(fits[:, 1], 1)[level]
        place = np.stack([level, inside // width, inside % width], axis=1).astype(np.int32)
        return Windows(place, np.zeros(len(place), np.float32))

    def _false(self, t: int, windows: Windows) -> Windows:
        """Those that show no true object of the template's class."""
        template = self._templates[t]
        own = np.array([label == self._classes[template.class_id] for label in self._frame.labels], dtype=bool)
        if not own.any() or len(windows.place) == 0:
            return windows
        overlap = box_ious(self.boxes(t, windows), part_box(self._frame.xyxy[own], template.part))
        return windows.select(overlap.max(axis=1) < self._ignored_overlap)

    def boxes(self, t: int, windows: Windows) -> np.ndarray:
        """(N, 4) pixels of the part in each of N windows of the template `t`."""
        boxes = np.zeros((len(windows.place), 4))
        for number in np.unique(windows.place[:, 0]):
            here = windows.place[:, 0] == number
            level = self._pyramid.levels[number]
            boxes[here] = part_boxes(self._templates[t], level, windows.place[here, 1:])
        return boxes


def _peaks(scores: np.ndarray, floor: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Template, row and column of the scores (T, h, w) above `floor` that none of their eight neighbours exceeds."""
    owner, row, column = np.nonzero(scores > floor)
    value = scores[owner, row, column]
    highest = np.ones(len(owner), dtype=bool)
    last_row, last_column = scores.shape[1] - 1, scores.shape[2] - 1
    for i, j in product((-1, 0, 1), (-1, 0, 1)):
        # Beside the rim this compares with a neighbour once more
        highest &= value >= scores[owner, np.clip(row + i, 0, last_row), np.clip(column + j, 0, last_column)]
    return owner[highest], row[highest], column[highest]


def _by_score(parts: Sequence[Windows]) -> Windows:
    """Windows of all levels by falling score; of equal ones that of the earlier level first."""
    place = np.concatenate([np.zeros((0, 3), np.int32), *(one.place for one in parts)])
    score = np.concatenate([np.zeros(0, np.float32), *(one.score for one in parts)])
    return Windows(place, score).select(np.argsort(-score, kind="stable"))
