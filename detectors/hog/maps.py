"""Probability of every class at every pixel (Lai et al. 2012, sections III-A and III-C).

A pixel's score is the best over the pyramid's levels of the window centred on it (eq. 2), its probability the
calibrated score (eq. 3). Windows are steps of a cell apart; between them log odds are interpolated linearly. Such a map
is strong near the middle of an object only. Boxes of a class that are probable enough spread it over the object by
depth (eq. 12, see `refinement`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit

from ...datasets.errors import UserError
from ...datasets.frame import Frame
from ..detections import Part
from ..probability_maps import ALPHA, ProbabilityMaps
from .candidates import ScoredLevel, windows_that_fit
from .model import HogTemplate
from .refinement import ClassBoxes, refine
from .score_vectors import LEAST
from .second_stage.judged import PROPOSED

SPACING = 4  # pixels of the grid on which levels are joined: as fine as the cells of the largest scale there can be


@dataclass(frozen=True, slots=True)
class MapConfig:
    """How maps are made of scores.

    Attributes:
        gamma: 1/m^2, of eq. (12): at a distance of 1 / sqrt(gamma) from the middle of a box the probability is 1/e of
            the box's. The paper gives no number. With 25 it is halved at 0.17 m. Over 271 true boxes of eight rendered
            tables (objects of 0.07 to 0.31 m), gamma from 22 to 35 tells objects from the rest of their boxes best,
            and no worse than one in proportion to each box's size does.
        refined_from: probability from which boxes are spread. The paper takes boxes from a score of -0.6 on, which is
            about this much where the margin's ends, -1 and 1, stand for 0.1 and 0.9.
        judged_from: the same of boxes that a second stage has judged, whose wrong ones cost more than its missed ones.
            Macro F of points by maps alone, three and three training tables: 0.831 and 0.906 from 0.35 on, 0.834 and
            0.907 from 0.5 on, 0.837 and 0.917 from 0.65 on.
        alpha: of the background's probability (eq. 5), as in the paper.

    Raises:
        UserError: for a value out of range.
    """

    gamma: float = 25.0
    refined_from: float = 0.2
    judged_from: float = 0.65
    alpha: float = ALPHA

    def __post_init__(self) -> None:
        shares = self.refined_from, self.judged_from
        if not (self.gamma >= 0.0 and all(0.0 <= p <= 1.0 for p in shares) and 0.0 < self.alpha <= 1.0):
            raise UserError(
                f"expected gamma >= 0, refined_from and judged_from in [0, 1] and alpha in (0, 1], but got {self}"
            )


def probability_maps(
    levels: Sequence[ScoredLevel],
    templates: Sequence[HogTemplate],
    classes: Sequence[str],
    frame: Frame,
    found: ClassBoxes,
    config: MapConfig,
    judged: bool = False,
) -> ProbabilityMaps:
    """Maps of the whole templates' classes, refined by boxes.

    Args:
        levels: scores of all templates.
        templates: as `levels` counts them.
        classes: K names.
        frame: for its size, depth and intrinsics.
        found: boxes of whole objects, of which those of `refined_from` and more are spread, or of `judged_from`.
        config: numbers.
        judged: whether the boxes are a second stage's. Then a window says no more than what it is proposed from: what
            is made of it, the boxes say.
    """
    height, width = frame.color.shape[:2]
    log_odds = _joined(levels, templates, len(classes), width, height)
    np.clip(log_odds, *np.log([LEAST / (1 - LEAST), (1 - LEAST) / LEAST]).astype(np.float32), out=log_odds)
    p = 1.0 / (1.0 + np.exp(-log_odds))
    if judged:
        np.minimum(p, np.float32(PROPOSED), out=p)
    sure = found.probability >= (config.judged_from if judged else config.refined_from)
    refine(p, frame, ClassBoxes(found.class_id[sure], found.xyxy[sure], found.probability[sure]), config.gamma)
    return ProbabilityMaps.of(classes, p, config.alpha)


def _joined(
    levels: Sequence[ScoredLevel], templates: Sequence[HogTemplate], classes: int, width: int, height: int
) -> np.ndarray:
    """(K, H, W) float32 log odds of the best window centred on each pixel; -100 where there is none."""
    whole = np.array([t for t, template in enumerate(templates) if template.part == Part.WHOLE], dtype=np.int64)
    class_id = np.array([templates[t].class_id for t in whole], dtype=np.int64)
    platt = np.array([templates[t].platt for t in whole], dtype=np.float64).reshape(-1, 2)
    rows, columns = -(-height // SPACING), -(-width // SPACING)
    grid = np.full((classes, rows, columns), -100.0, dtype=np.float32)
    for level in levels:
        centres = (level.first[whole, :2] + level.first[whole, 2:]) / 2.0
        _raise(grid, level.scores, whole, centres, level.step, class_id, platt)
    full = np.empty((classes, height, width), dtype=np.float32)
    for k in range(classes if rows * columns else 0):
        resized = cv2.resize(grid[k], (columns * SPACING, rows * SPACING), interpolation=cv2.INTER_LINEAR)
        full[k] = resized[:height, :width]
    return full


@njit(cache=True)
def _raise(grid, scores, whole, centres, step, class_id, platt) -> None:
    """Raise the (K, rows, columns) log odds of a grid's points to those of one level, where it has windows."""
    for w in range(len(whole)):
        t, k, u, v = whole[w], class_id[w], platt[w, 0], platt[w, 1]
        height, width = windows_that_fit(scores[t])
        if height == 0 or width == 0:
            continue
        for a in range(grid.shape[1]):
            y = ((a + 0.5) * SPACING - centres[w, 1]) / step
            if y < -0.5 or y > height - 0.5:  # no window's centre within half a step
                continue
            y = min(max(y, 0.0), height - 1.0)
            i = min(int(y), max(height - 2, 0))
            below, down = min(i + 1, height - 1), y - i
            for b in range(grid.shape[2]):
                x = ((b + 0.5) * SPACING - centres[w, 0]) / step
                if x < -0.5 or x > width - 0.5:
                    continue
                x = min(max(x, 0.0), width - 1.0)
                j = min(int(x), max(width - 2, 0))
                beside, right = min(j + 1, width - 1), x - j
                upper = (1.0 - right) * scores[t, i, j] + right * scores[t, i, beside]
                lower = (1.0 - right) * scores[t, below, j] + right * scores[t, below, beside]
                score = (1.0 - down) * upper + down * lower
                grid[k, a, b] = max(grid[k, a, b], -(u * score + v))
