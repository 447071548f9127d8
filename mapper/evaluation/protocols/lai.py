"""Protocol 2: labels of points, as Lai et al. (Detection-based Object Labeling in 3D Scenes, section IV-B) score them.

Every point of the scene has a label, one of the object categories or background. The micro F-score is that of all
points together; as every point has one label, precision, recall and F are all the share of right ones. The macro
F-score gives every category equal weight. Of the two naive labellings, Random draws among the categories and the
background alike, AllBG calls everything background.

The paper's text averages "the F-scores of the five categories". Its own numbers average the background too: AllBG has
15.8, which is 94.9 / 6, and the precisions and recalls of figure 5 give Det3DMRF 87.9 over five, 89.8 (as printed in
figure 4) over six. Both are given here: "macro F" by the text, "macro F with background" by the figures. The overall
precision and recall are averages with background, as in figure 5. (What figure 4 prints as micro F of its detectors,
such as 89.9, is the F of those two averages: last row of the table by category.)
"""

from __future__ import annotations

import numpy as np

from ....datasets.truth import NO_OBJECT
from ..inputs.case import Case
from ..points.label_scores import LabelScores, mean_f, mean_precision, mean_recall, score_labels
from ..points.labelled_points import label_points
from ..result import Better, Metric, ProtocolResult, Table

SEED = 0  # of the random labelling


def evaluate(case: Case) -> ProtocolResult:
    """Score the labels of the map's points.

    Raises:
        NotEvaluated: there is no labelled true cloud, no cloud of the map, or no point in common.
    """
    points, classes = label_points(case), case.truth.classes
    own = score_labels(points.found, points.true, classes)
    random = score_labels(random_labels(len(points.true), len(classes)), points.true, classes)
    background = score_labels(np.full(len(points.true), NO_OBJECT), points.true, classes)
    labellings = (("map", own), ("Random", random), ("AllBG", background))
    return ProtocolResult(
        protocol="lai",
        title="Labelled points",
        follows="Lai et al., Detection-based Object Labeling in 3D Scenes, section IV-B, figures 4 and 5",
        metrics=(*_metrics(own, random, background), Metric("object points covered", points.covered)),
        tables=(
            Table("F-scores", ("labelling", "micro F", "macro F", "macro F with background"), _f_rows(labellings)),
            Table(
                "By category",
                ("category", "true points", "labelled points", "precision", "recall", "F"),
                (*_category_rows(own), _overall_row(own)),
            ),
        ),
        notes=(
            *points.notes(case.config.point_distance),
            "Categories without true points are in no average; one that was never named has precision 0 there.",
            "Macro F averages the object categories, as the paper's text says; its figures include the background.",
            "Object points covered: share of the true points of objects that have a point of the map nearby.",
            f"Random draws uniformly among {len(classes)} categories and background.",
        ),
    )


def random_labels(count: int, classes: int) -> np.ndarray:
    """(N,) labels drawn uniformly among all classes and background, the same every time."""
    return np.random.default_rng(SEED).integers(NO_OBJECT, classes, size=count)


def _metrics(own: LabelScores, random: LabelScores, background: LabelScores) -> tuple[Metric, ...]:
    return (
        Metric("micro F", own.accuracy),
        Metric("macro F", mean_f(own.objects)),
        Metric("macro F with background", mean_f(own.all)),
        Metric("overall precision", mean_precision(own.all)),
        Metric("overall recall", mean_recall(own.all)),
        Metric("Random micro F", random.accuracy, better=Better.NEITHER),
        Metric("Random macro F", mean_f(random.objects), better=Better.NEITHER),
        Metric("AllBG micro F", background.accuracy, better=Better.NEITHER),
        Metric("AllBG macro F", mean_f(background.objects), better=Better.NEITHER),
    )


def _f_rows(labellings: tuple[tuple[str, LabelScores], ...]) -> tuple[tuple[str | float | None, ...], ...]:
    return tuple((name, scores.accuracy, mean_f(scores.objects), mean_f(scores.all)) for name, scores in labellings)


def _category_rows(scores: LabelScores) -> tuple[tuple[str | float | None, ...], ...]:
    return tuple((one.name, one.points, one.labelled, one.precision, one.recall, one.f_score) for one in scores.all)


def _overall_row(scores: LabelScores) -> tuple[str | float | None, ...]:
    """Averages over categories and background, and the F of the two."""
    precision, recall = mean_precision(scores.all), mean_recall(scores.all)
    total = sum(one.points for one in scores.all)
    both = precision + recall if precision is not None and recall is not None else 0.0
    f_score = 2.0 * precision * recall / both if both and precision is not None and recall is not None else None
    return ("overall", total, total, precision, recall, f_score)
