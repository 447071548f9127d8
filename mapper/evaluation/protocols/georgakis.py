"""Protocol 1: boxes of single and of many views, as Georgakis et al. (RGB-D Multi-View Object Detection with Object
Proposals and Shape Context, section IV) score them.

Every `frame_step`-th frame is judged, and a box is right at an IoU of `box_iou` (rules in `boxes.matching`; the paper
asks for more than 0.5, here 0.5 itself is enough).

Single view: the detector's boxes in those frames. Average precision by class as in table I, though a box is ranked in
its best class only, and there each class has a detector of its own. Precision and recall as in table II at one
"empirical threshold" for all classes, which here is the one with the best F1 on these very frames: the single view gets
the benefit of hindsight, the map does not.

Multi-view: the things of the final map, projected into the same frames with the poses that the run itself estimated
for them, so that no alignment with the truth enters. Precision and recall are those of things with a belief of at least
`believed`; average precision ranks all things by belief. A thing counts once, in the class that the map calls it. It
claims to be there in every frame into which it projects, be it hidden or not: on a hardly visible object of its class
it is ignored, on nothing it is a false positive, also where something else would hide it, provided half of its box is
in the image.

The headline precision and recall are of the boxes of all classes together. The averages of table II weigh classes
alike and count proposals that are called background as a class; a map proposes no background, so the last rows of the
table of boxes average the object classes alone.

Points: precision and recall by class, background among them, as in the last rows of table II.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..boxes.curves import Scored, at_threshold, average_precision, best_threshold, precision_recall, thinned
from ..boxes.image_boxes import check_boxes, detected_boxes, frame_boxes
from ..boxes.matching import Matches, match_boxes, scored
from ..boxes.pictures import worst_boxes
from ..boxes.projection import projected_boxes
from ..inputs.case import Case
from ..points.label_scores import LabelScores, mean_precision, mean_recall, score_labels
from ..points.labelled_points import label_points
from ..result import Better, Metric, NotEvaluated, Plot, PlotKind, ProtocolResult, Series, Table, WorstCase

SINGLE, MULTI = "single-view", "multi-view"

Row = tuple[str | float | int | None, ...]


def evaluate(case: Case) -> ProtocolResult:
    """Score the detector's boxes, the map's and the labelled points, whichever of them can be.

    Raises:
        NotEvaluated: none of them can; the message has every reason.
    """
    metrics: list[Metric] = []
    tables: list[Table] = []
    plots: tuple[Plot, ...] = ()
    worst: tuple[WorstCase, ...] = ()
    notes: list[str] = []
    lacks: list[str] = []
    try:
        views = _match_views(case)
        thresholds = {name: _threshold(case, name, matches) for name, matches in views.items()}
        metrics += [metric for name in views for metric in _box_metrics(case, name, views[name], thresholds[name])]
        tables.append(_box_table(case, views, thresholds))
        plots = (_plot(views),)
        worst = worst_boxes(case, views[MULTI])
        notes += _box_notes(case, views)
    except NotEvaluated as lack:
        lacks.append(f"boxes: {lack}")
    try:
        points = label_points(case)
        labels = score_labels(points.found, points.true, case.truth.classes)
        metrics += [
            Metric("point precision", mean_precision(labels.all)),
            Metric("point recall", mean_recall(labels.all)),
        ]
        tables.append(_point_table(labels))
        notes += points.notes(case.config.point_distance)
    except NotEvaluated as lack:
        lacks.append(f"points: {lack}")
    if not tables:
        raise NotEvaluated("; ".join(lacks))
    return ProtocolResult(
        protocol="georgakis",
        title="Boxes, single and multi-view",
        follows="Georgakis et al., RGB-D Multi-View Object Detection with Object Proposals and Shape Context, "
        "section IV, tables I and II",
        metrics=tuple(metrics),
        tables=tuple(tables),
        plots=plots,
        worst=worst,
        notes=(*notes, *(f"Not evaluated: {lack}." for lack in lacks)),
    )


def _match_views(case: Case) -> dict[str, list[Matches]]:
    """The matched boxes of the judged frames, by `SINGLE` (absent without a detector) and `MULTI`."""
    check_boxes(case.truth)
    intrinsics, iou = case.truth.intrinsics, case.config.box_iou
    assert intrinsics is not None  # as checked
    views: dict[str, list[Matches]] = {MULTI: []} if case.detections is None else {SINGLE: [], MULTI: []}
    for frame, row in zip(case.truth_index.tolist(), case.run_index.tolist(), strict=True):
        true = frame_boxes(case, frame) if frame % case.config.frame_step == 0 else None
        if true is None:
            continue
        object_map, pose = case.run.object_map, case.run.poses[row]
        claimed = projected_boxes(case.things, object_map, pose, case.truth.classes, intrinsics)
        views[MULTI].append(match_boxes(claimed, true, iou, frame))
        if case.detections is not None:
            detected = detected_boxes(case.detections(frame), case, intrinsics)
            views[SINGLE].append(match_boxes(detected, true, iou, frame))
    if not views[MULTI]:
        step = case.config.frame_step
        raise NotEvaluated(f"no frame that was mapped and is annotated has a number divisible by {step}")
    return views


def _box_notes(case: Case, views: dict[str, list[Matches]]) -> list[str]:
    return [
        f"{len(views[MULTI])} frames, numbers divisible by {case.config.frame_step}; an object counts in each of them.",
        f"Objects visible by less than {case.config.min_visibility:.0%} are neither missed nor false.",
        "The single view's threshold is the one with the best F1 on these frames: hindsight in its favour."
        if SINGLE in views
        else "Not evaluated: single view: there is no detector.",
        "Precision, recall and F1 above are of all boxes together; the paper averages over classes, as the table does.",
        "Things of the map are drawn as upright elliptic cylinders, from the poses that the run estimated.",
        "A thing that is on no object is false in every frame that it projects into, hidden there or not.",
    ]


def _threshold(case: Case, name: str, matches: list[Matches]) -> float | None:
    """Score from which a box counts; None for a detector that found nothing at all."""
    return case.config.believed if name == MULTI else best_threshold(scored(matches))


def _box_metrics(case: Case, name: str, matches: list[Matches], threshold: float | None) -> list[Metric]:
    point = at_threshold(scored(matches), threshold)
    by_class = [average_precision(scored(matches, number)) for number in range(len(case.truth.classes))]
    metrics = [
        Metric(f"{name} mAP", _mean(by_class)),
        Metric(f"{name} precision", point.precision),
        Metric(f"{name} recall", point.recall),
        Metric(f"{name} F1", point.f1),
    ]
    if name == SINGLE:
        metrics.append(Metric(f"{name} threshold", threshold, better=Better.NEITHER))
    return metrics


def _box_table(case: Case, views: dict[str, list[Matches]], thresholds: dict[str, float | None]) -> Table:
    """A row a class that is in these frames or is claimed to be, their mean, and all boxes as if of one class."""
    parts = ("AP", "precision", "recall")
    columns = ("class", "objects seen", *(f"{name} {part}" for name in (SINGLE, MULTI) for part in parts))
    rows: list[Row] = []
    for number, label in enumerate(case.truth.classes):
        ranked = {name: scored(matches, number) for name, matches in views.items()}
        if any(one.objects or len(one.scores) for one in ranked.values()):
            rows.append(_box_row(label, ranked, thresholds))
    mean: Row = ("mean of classes", None, *(_mean([row[k] for row in rows]) for k in range(2, len(columns))))
    everything = _box_row("all classes", {name: scored(matches) for name, matches in views.items()}, thresholds)
    return Table(f"Boxes, IoU at least {case.config.box_iou:g}", columns, (*rows, mean, everything))


def _box_row(label: str, ranked: dict[str, Scored], thresholds: dict[str, float | None]) -> Row:
    numbers: list[float | None] = []
    for name in (SINGLE, MULTI):
        if name in ranked:
            point = at_threshold(ranked[name], thresholds[name])
            numbers += [average_precision(ranked[name]), point.precision, point.recall]
        else:
            numbers += [None, None, None]
    return (label, ranked[MULTI].objects, *numbers)


def _point_table(labels: LabelScores) -> Table:
    rows: list[Row] = [(one.name, one.points, one.precision, one.recall) for one in labels.all]
    mean: Row = ("mean", None, mean_precision(labels.all), mean_recall(labels.all))
    return Table("Points", ("class", "points", "precision", "recall"), (*rows, mean))


def _plot(views: dict[str, list[Matches]]) -> Plot:
    series = []
    for name, matches in views.items():
        recall, precision = precision_recall(scored(matches))
        series.append(Series(name, *thinned(recall, precision), PlotKind.LINE))
    return Plot("Precision and recall, all classes", "recall", "precision", tuple(series), (0.0, 1.0, 0.0, 1.0))


def _mean(values: Iterable) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
