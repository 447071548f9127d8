"""Precision, recall and false positives per image of ranked claims, as the threshold of their score falls.

Claims of equal score pass any threshold together, so no number here depends on the order in which they were made.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

MOST_POINTS = 200  # of a curve in a report


@dataclass(frozen=True, slots=True, eq=False)
class Scored:
    """Claims with their scores, and what there was to find.

    Attributes:
        scores: (N,) of the claims.
        right: (N,) bool: true positive, or else false positive.
        objects: how many there were to find.
        images: in how many images.
    """

    scores: np.ndarray
    right: np.ndarray
    objects: int
    images: int

    @classmethod
    def pooled(cls, several: Iterable[Scored]) -> Scored:
        """Those of several sequences as one."""
        items = list(several)
        return cls(
            np.concatenate([np.empty(0), *(item.scores for item in items)]),
            np.concatenate([np.empty(0, dtype=bool), *(item.right for item in items)]),
            sum(item.objects for item in items),
            sum(item.images for item in items),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Counts:
    """(K,) falling values of `threshold`, and how many `right` and `wrong` claims have at least that score."""

    threshold: np.ndarray
    right: np.ndarray
    wrong: np.ndarray


def counts(scored: Scored) -> Counts:
    """True and false positives at every distinct score."""
    order = np.argsort(-scored.scores, kind="stable")
    scores, right = scored.scores[order], scored.right[order]
    last = np.flatnonzero(np.append(np.diff(scores) != 0.0, True)) if len(scores) else np.zeros(0, dtype=np.int64)
    return Counts(scores[last], np.cumsum(right)[last], np.cumsum(~right)[last])


def precision_recall(scored: Scored) -> tuple[np.ndarray, np.ndarray]:
    """(K,) recall, rising, and (K,) precision interpolated: the best at that recall or a higher one.

    Both are empty where there was nothing to find or nothing was claimed.
    """
    passed = counts(scored)
    if scored.objects == 0:
        return np.empty(0), np.empty(0)
    precision = passed.right / (passed.right + passed.wrong)
    return passed.right / scored.objects, np.maximum.accumulate(precision[::-1])[::-1]


def average_precision(scored: Scored) -> float | None:
    """Area under the interpolated curve at all its points (Everingham et al., PASCAL VOC since 2010).

    AP = sum_k (r_k - r_(k-1)) p(r_k),  p(r) = max of precision at recall >= r; None where there was nothing to find.
    """
    if scored.objects == 0:
        return None
    recall, precision = precision_recall(scored)
    return float(np.sum(np.diff(recall, prepend=0.0) * precision))


def recall_per_false_positives(scored: Scored) -> tuple[np.ndarray, np.ndarray]:
    """(K,) false positives per image and (K,) recall, both rising; empty as for `precision_recall`."""
    if scored.objects == 0 or scored.images == 0:
        return np.empty(0), np.empty(0)
    passed = counts(scored)
    return passed.wrong / scored.images, passed.right / scored.objects


def recall_at(scored: Scored, false_per_image: float) -> float | None:
    """Best recall with at most so many false positives per image; None where there was nothing to find."""
    if scored.objects == 0:
        return None
    fppi, recall = recall_per_false_positives(scored)
    return float(np.max(recall[fppi <= false_per_image], initial=0.0))


@dataclass(frozen=True, slots=True)
class OperatingPoint:
    """Shares at one threshold; None where they are undefined: precision of no claim, recall of no object."""

    precision: float | None
    recall: float | None
    f1: float | None


def at_threshold(scored: Scored, threshold: float | None) -> OperatingPoint:
    """Precision, recall and F1 = 2 right / (claims + objects) of claims with at least this score; None passes none."""
    passing = scored.scores >= (np.inf if threshold is None else threshold)
    right, claims = int(np.sum(scored.right[passing])), int(np.sum(passing))
    return OperatingPoint(
        right / claims if claims else None,
        right / scored.objects if scored.objects else None,
        2.0 * right / (claims + scored.objects) if claims + scored.objects else None,
    )


def best_threshold(scored: Scored) -> float | None:
    """The score with the highest F1, the higher of equals; None without claims."""
    passed = counts(scored)
    if len(passed.threshold) == 0:
        return None
    f1 = 2.0 * passed.right / (passed.right + passed.wrong + scored.objects)
    return float(passed.threshold[np.argmax(f1)])


def thinned(x: np.ndarray, y: np.ndarray) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """At most `MOST_POINTS` points of a curve, evenly by number, the first and the last among them."""
    if len(x) > MOST_POINTS:
        kept = np.unique(np.linspace(0, len(x) - 1, MOST_POINTS).round().astype(np.int64))
        x, y = x[kept], y[kept]
    return tuple(x.tolist()), tuple(y.tolist())
