"""What every class makes of a detection's place.

A detection is a window of one class. Its score vector asks the templates of every class, of the same part, about the
windows on it: those whose box has an intersection over union of 0.5 with the detection's, as much as a right box has to
have with the true one. The best of them speaks. A window that a better detection suppresses is about that one, and does
not count: a bowl beside a mug must not make the mug a bowl, nor lend its score to a lesser box about its own rim.

Where the boxes of a class differ so much in shape that none overlaps by half, its window of most overlap speaks: if it
is probable although its object would be of another shape, that is worth knowing, and if not it says so itself. Only a
class that has no window there at all (no template of that part, or an image too small for it) has no score: NaN.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from scipy.special import expit

from .candidates import Candidates, ScoredLevel, windows_that_fit
from .model import HogTemplate
from .suppression import overlap

SAME_PLACE = 0.5  # intersection over union from which two boxes are about one object (as for detections in PASCAL VOC)
LEAST = 1e-6  # probability: no finite number of training windows says less


def score_vectors(
    kept: Candidates, levels: Sequence[ScoredLevel], templates: Sequence[HogTemplate], classes: int, nms_iou: float
) -> np.ndarray:
    """Scores of K classes for each of N detections (see the module).

    Args:
        kept: detections, the best first.
        levels: scores of all windows.
        templates: as `levels` counts them.
        classes: K.
        nms_iou: intersection over union above which a detection suppresses a window.

    Returns:
        (N, K) probabilities of at least `LEAST`, or NaN.
    """
    on_it = np.full((len(kept), classes), -np.inf)
    nearest, closeness = on_it.copy(), np.zeros_like(on_it)
    if len(kept) and templates:
        part = np.array([template.part for template in templates], dtype=np.int64)
        class_id = np.array([template.class_id for template in templates], dtype=np.int64)
        platt = np.array([template.platt for template in templates], dtype=np.float64)
        boxes, box_part = np.ascontiguousarray(kept.xyxy, dtype=np.float64), kept.part.astype(np.int64)
        for level in levels:
            args = (level.scores, level.first, level.step, part, class_id, platt)
            _ask_level(boxes, box_part, nms_iou, *args, on_it, nearest, closeness)
    log_odds = np.where(on_it > -np.inf, on_it, nearest)
    return np.where(log_odds > -np.inf, expit(log_odds).clip(LEAST, 1.0), np.nan)


@njit(cache=True)
def _ask_level(
    boxes, box_part, nms_iou, scores, first, step, part, class_id, platt, on_it, nearest, closeness
) -> None:  # fmt: skip
    """Raise (N, K) log odds `on_it`, and `nearest` with its overlap `closeness`, by the windows of one level."""
    window = np.empty(4)
    for t in range(len(first)):
        k = class_id[t]
        height, width = windows_that_fit(scores[t])
        for n in range(len(boxes) if height > 0 and width > 0 else 0):
            box = boxes[n]
            if part[t] != box_part[n]:
                continue
            left, right = _places(box[0], box[2], first[t, 0], first[t, 2], step, width)
            top, bottom = _places(box[1], box[3], first[t, 1], first[t, 3], step, height)
            for i in range(top, bottom + 1):
                for j in range(left, right + 1):
                    for side in range(4):
                        window[side] = first[t, side] + step * (j if side % 2 == 0 else i)
                    close = overlap(window, box)
                    log_odds = -(platt[t, 0] * scores[t, i, j] + platt[t, 1])
                    if close > closeness[n, k]:
                        closeness[n, k] = close
                        nearest[n, k] = log_odds
                    better = close >= SAME_PLACE and log_odds > on_it[n, k]
                    if better and not _is_suppressed(window, n, boxes, box_part, nms_iou):
                        on_it[n, k] = log_odds


@njit(cache=True)
def _places(low: float, high: float, first_low: float, first_high: float, step: float, count: int) -> tuple[int, int]:
    """First and last place on one axis at which a window may have half its union in common with a box.

    Two intervals a and b whose intersection is half their union, or more where the boxes differ on the other axis too,
    have centres no further apart than (a + b) / 6. The nearest place is always among them.
    """
    reach = max((high - low + first_high - first_low) / 6.0, step / 2.0)
    apart = (low + high - first_low - first_high) / 2.0
    begin, end = np.ceil((apart - reach) / step - 1e-9), np.floor((apart + reach) / step + 1e-9)
    last = float(count - 1)
    return int(min(max(begin, 0.0), last)), int(max(min(end, last), 0.0))


@njit(cache=True)
def _is_suppressed(window: np.ndarray, n: int, boxes: np.ndarray, box_part: np.ndarray, nms_iou: float) -> bool:
    """Whether a detection of the same part that is better than the n-th suppresses a window."""
    is_lost = False
    for m in range(n):
        is_lost = is_lost or (box_part[m] == box_part[n] and overlap(window, boxes[m]) > nms_iou)
    return is_lost
