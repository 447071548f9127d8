"""Precision, recall and F-scores of labelled points.

For a class k with n_k points, of which t_k are labelled k, and m_k points labelled k in all:

    precision = t_k / m_k      recall = t_k / n_k      F = 2 t_k / (m_k + n_k)

A class without points has neither recall nor F and is left out of averages; what is wrongly labelled so is missing
from the recall of another. A class that has points but that no point was labelled counts as precision 0 in averages,
so that a labelling gains nothing by never naming it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....datasets.truth import NO_OBJECT

BACKGROUND = "background"


@dataclass(frozen=True, slots=True)
class LabelScore:
    """One class: its name, its `points`, and shares; None where undefined."""

    name: str
    points: int
    labelled: int
    precision: float | None
    recall: float | None
    f_score: float | None


@dataclass(frozen=True, slots=True)
class LabelScores:
    """All classes of a labelling of the same points.

    Attributes:
        objects: object classes that have points, or that points were labelled as.
        background: everything else.
        accuracy: share of points with the right label, background being a label too.
    """

    objects: tuple[LabelScore, ...]
    background: LabelScore
    accuracy: float

    @property
    def all(self) -> tuple[LabelScore, ...]:
        """Object classes, then the background."""
        return (*self.objects, self.background)


def score_labels(found: np.ndarray, true: np.ndarray, classes: Sequence[str]) -> LabelScores:
    """Compare (N,) found with (N,) true labels: indices into `classes`, or `NO_OBJECT` for background."""
    count = len(classes) + 1  # the background comes last
    confusion = np.zeros((count, count), dtype=np.int64)
    np.add.at(confusion, (_codes(true, count), _codes(found, count)), 1)
    right, points, labelled = np.diag(confusion), confusion.sum(axis=1), confusion.sum(axis=0)
    scores = [
        LabelScore(
            name=name,
            points=int(n),
            labelled=int(m),
            precision=float(t / m) if m else None,
            recall=float(t / n) if n else None,
            f_score=float(2.0 * t / (m + n)) if n else None,
        )
        for name, t, n, m in zip([*classes, BACKGROUND], right, points, labelled, strict=True)
    ]
    objects = tuple(score for score in scores[:-1] if score.points or score.labelled)
    return LabelScores(objects, scores[-1], float(right.sum() / max(len(true), 1)))


def mean_precision(scores: Sequence[LabelScore]) -> float | None:
    """Over classes that have points."""
    return _mean([score.precision or 0.0 for score in scores if score.points])


def mean_recall(scores: Sequence[LabelScore]) -> float | None:
    """Over classes that have points."""
    return _mean([score.recall for score in scores if score.recall is not None])


def mean_f(scores: Sequence[LabelScore]) -> float | None:
    """Over classes that have points."""
    return _mean([score.f_score for score in scores if score.f_score is not None])


def _codes(labels: np.ndarray, count: int) -> np.ndarray:
    return np.where(labels == NO_OBJECT, count - 1, labels)


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None
