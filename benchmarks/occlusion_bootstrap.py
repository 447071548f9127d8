"""Recall and average precision of pooled scenes, and how much they would differ with other scenes.

Scenes are drawn again with replacement (Efron 1979), and every draw is pooled as the scenes themselves are: a draw is
how often each scene counts, so one sorted list of claims serves all draws. All methods share the draws, which makes
their differences those of the same scenes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thingmap.mapper.evaluation.boxes.curves import Scored, average_precision, recall_at
from thingmap.mapper.evaluation.protocols.meger import FALSE_PER_IMAGE

DRAWS = 500
CONFIDENCE = 0.95
NOTHING = Scored(np.empty(0), np.empty(0, dtype=bool), 0, 0)  # of a scene in which a method could not be judged


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Values of [recall at one false positive an image, average precision], NaN where there was nothing to find.

    Attributes:
        scored: the scenes' ranked outcomes as one.
        value: (2,) of the scenes, by the evaluator's own functions.
        drawn: (R, 2) of every draw.
    """

    scored: Scored
    value: np.ndarray
    drawn: np.ndarray


@dataclass(frozen=True, slots=True)
class Difference:
    """A difference of shares, and the interval that holds it with probability `CONFIDENCE`."""

    value: float
    low: float
    high: float

    @property
    def sure(self) -> bool:
        """Whether all of the interval is above zero."""
        return self.low > 0.0


def draw_scenes(scenes: int, seed: int = 0, draws: int = DRAWS) -> np.ndarray:
    """(R, S) how often each of S scenes is in each draw of S scenes."""
    return np.random.default_rng(seed).multinomial(scenes, np.full(scenes, 1.0 / scenes), size=draws)


def measure(scenes: Sequence[Scored | None], weights: np.ndarray) -> Measured:
    """What a method made of S scenes; (R, S) weights as of `draw_scenes`. None: it could not be judged in that one."""
    items = [NOTHING if scene is None else scene for scene in scenes]
    pooled = Scored.pooled(items)
    values = recall_at(pooled, FALSE_PER_IMAGE), average_precision(pooled)
    return Measured(pooled, np.array([np.nan if v is None else v for v in values]), weighted(items, weights))


def weighted(scenes: Sequence[Scored], weights: np.ndarray) -> np.ndarray:
    """(R, 2) as `recall_at` and `average_precision` of the scenes pooled, scene s counted `weights[r, s]` times."""
    owner = np.repeat(np.arange(len(scenes)), [len(scene.scores) for scene in scenes])
    pooled = Scored.pooled(scenes)
    order = np.argsort(-pooled.scores, kind="stable")
    last = np.flatnonzero(np.diff(pooled.scores[order], append=-np.inf) != 0.0)  # equal scores pass together
    each, right = weights[:, owner[order]], pooled.right[order]
    found, wrong = (np.cumsum(each * flag, axis=1)[:, last] for flag in (right, ~right))
    objects, images = (weights @ np.array([[s.objects, s.images] for s in scenes])).T[:, :, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        recall = found / objects
        within = np.where(wrong / images <= FALSE_PER_IMAGE, recall, 0.0).max(axis=1, initial=0.0)
        precision = np.nan_to_num(found / (found + wrong))  # before the first claim of a draw there is none
    best = np.maximum.accumulate(precision[:, ::-1], axis=1)[:, ::-1]
    area = np.sum(np.diff(recall, prepend=0.0, axis=1) * best, axis=1)
    return np.where(objects > 0, np.stack([within, area], axis=1), np.nan)


def mean_difference(one: Sequence[Measured], other: Sequence[Measured], metric: int) -> Difference:
    """Mean over several numbers of views of one method's `metric` (0 recall, 1 precision) less the other's."""
    value = np.mean([a.value[metric] - b.value[metric] for a, b in zip(one, other, strict=True)])
    drawn = np.mean([a.drawn[:, metric] - b.drawn[:, metric] for a, b in zip(one, other, strict=True)], axis=0)
    tail = (1.0 - CONFIDENCE) / 2.0
    known = drawn[np.isfinite(drawn)]
    low, high = np.quantile(known, [tail, 1.0 - tail]) if len(known) else (np.nan, np.nan)
    return Difference(float(value), float(low), float(high))
