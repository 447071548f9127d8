"""Tables and plots of protocol 4."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ....datasets.truth import TrueObject
from ..inputs.case import Case, PlacedThing
from ..result import Plot, PlotKind, Series, Table
from .errors import EXTENTS, Errors
from .matching import Matching, same_label
from .scores import Scores
from .seen import SeenObjects

OCCLUSION_STEP = 0.1  # width of bins of mean occlusion (Meger et al., Clutter, section IV, bin occlusion so)
OCCLUSION_COLUMNS = ("mean occlusion", "middle of bin", "objects", "recall", "joint recall")
HISTOGRAM_BINS = 20
SMALLEST_SPAN_MM, SMALLEST_SPAN_LOG = 10.0, 0.1  # of histograms: 1 cm, and 10 % in either direction
AXES = ("x", "y", "z")  # of the truth's world

Summary = Callable[[np.ndarray], "np.floating | float"]


def summarise(values: np.ndarray, summary: Summary) -> float | None:
    """A summary of the values that are known (not NaN); None where none is."""
    known = values[~np.isnan(values)]
    return float(summary(known)) if known.size else None


def p95(values: np.ndarray) -> float:
    """The 95th percentile."""
    return float(np.percentile(values, 95.0))


def class_table(matching: Matching, classes: tuple[str, ...], exhaustive: bool) -> Table:
    """Scores by class: `found` by the object's class, `things` and precision by the thing's."""
    rows = []
    for label in classes:
        found = [thing for thing, true in matching.matched if same_label(true.label, label)]
        scores = Scores(
            wanted=sum(same_label(true.label, label) for true in matching.wanted),
            claimed=sum(same_label(thing.label, label) for thing in matching.claims),
            matched=len(found),
            right=sum(same_label(thing.label, label) for thing in found),
            exhaustive=exhaustive,
        )
        if scores.wanted or scores.claimed:
            shares = (scores.recall, scores.joint_recall, scores.joint_precision, scores.joint_f1, scores.count_ratio)
            rows.append((label, scores.wanted, scores.claimed, scores.matched, scores.right, *shares))
    columns = ("class", "objects", "things", "found", "right label", "recall")
    columns += ("joint recall", "joint precision", "joint F1", "count ratio")
    return Table("Objects by class", columns, tuple(rows))


def occlusion_table(matching: Matching, seen: SeenObjects) -> Table:
    """Recall by the mean occlusion of objects, in bins of `OCCLUSION_STEP`; empty bins have no row."""
    name_of = {true.id: thing.label for thing, true in matching.matched}
    bins: dict[int, list[tuple[bool, bool]]] = {}
    count = round(1.0 / OCCLUSION_STEP)
    for true in matching.wanted:
        if true.id in seen.occlusion:
            # The tiny term puts 1 - 0.7, which is 0.30000000000000004, and 0.3 into the same bin.
            k = min(int(seen.occlusion[true.id] / OCCLUSION_STEP + 1e-9), count - 1)
            found = true.id in name_of
            bins.setdefault(k, []).append((found, found and same_label(name_of[true.id], true.label)))
    rows = []
    for k, outcomes in sorted(bins.items()):
        recall, joint = np.mean(outcomes, axis=0).tolist()
        low, high = k * OCCLUSION_STEP, (k + 1) * OCCLUSION_STEP
        rows.append((f"{low:.1f} to {high:.1f}", (low + high) / 2, len(outcomes), recall, joint))
    return Table("Recall by mean occlusion", OCCLUSION_COLUMNS, tuple(rows))


def occlusion_plot(table: Table) -> Plot:
    """The columns of `occlusion_table` as curves over the middles of the bins."""
    middle, recall, joint = (tuple(float(row[k] or 0.0) for row in table.rows) for k in (1, 3, 4))
    series = (Series("found", middle, recall), Series("found by its name", middle, joint))
    return Plot(table.title, "mean occlusion", "recall", series, (0.0, 1.0, 0.0, 1.0))


def matching_table(by_distance: Scores, by_volume: Mapping[float, Scores | None]) -> Table:
    """The same counts and shares by every criterion; one that cannot be applied has no row."""
    rows = []
    for name, scores in (("centre distance", by_distance), *((f"IoU {iou:g}", s) for iou, s in by_volume.items())):
        if scores is not None:
            detection = (scores.precision, scores.recall, scores.f1)
            joint = (scores.joint_precision, scores.joint_recall, scores.joint_f1)
            rows.append((name, scores.wanted, scores.claimed, scores.matched, scores.right, *detection, *joint))
    columns = ("matched by", "objects", "things", "found", "right label", "precision", "recall", "F1")
    return Table("Objects by matching", (*columns, "joint precision", "joint recall", "joint F1"), tuple(rows))


def centre_table(errors: Errors) -> Table:
    """Errors of centres, in all and along the axes of the truth's world."""
    columns = {"distance": errors.distance, **dict(zip(AXES, errors.centre.T, strict=True))}
    rows = []
    for name, metres in columns.items():
        summaries = (np.mean, lambda values: np.median(np.abs(values)), lambda values: p95(np.abs(values)))
        rows.append((name, *(summarise(1000.0 * metres, summary) for summary in summaries)))
    return Table("Centre errors, mm", ("along", "mean (thing - object)", "median |error|", "95 % |error|"), tuple(rows))


def size_table(errors: Errors) -> Table:
    """Errors of extents, compared sorted."""
    rows = []
    for name, logs, metres in zip(EXTENTS, errors.log_size.T, errors.size.T, strict=True):
        summaries = (summarise(logs, np.median), summarise(np.abs(logs), np.median))
        rows.append((name, *summaries, summarise(100.0 * np.abs(metres), np.median)))
    columns = ("extent", "median ln(thing / object)", "median |ln|", "median |error|, cm")
    return Table("Size errors", columns, tuple(rows))


def false_table(case: Case, false: Sequence[tuple[PlacedThing, TrueObject]]) -> Table:
    """Every known false detection, with the things that are believed to be one."""
    rows = []
    for claim in case.truth.false_detections:
        things = [thing.thing.id for thing, other in false if other is claim]
        rows.append((claim.label, *claim.position.tolist(), ", ".join(things) or "none"))
    return Table("Known false detections", ("class", "x, m", "y, m", "z, m", "believed"), tuple(rows))


def histograms(errors: Errors) -> tuple[Plot, ...]:
    """How errors of centres and sizes are spread; none without matched pairs."""
    centre, size = 1000.0 * errors.distance, errors.log_size[np.isfinite(errors.log_size)]
    plots = []
    if len(centre):
        plots.append(_histogram("Centre errors", "mm", "pairs", centre, (0.0, SMALLEST_SPAN_MM)))
    if len(size):
        span = (-SMALLEST_SPAN_LOG, SMALLEST_SPAN_LOG)
        plots.append(_histogram("Size errors", "ln(thing / object)", "extents of pairs", size, span))
    return tuple(plots)


def _histogram(title: str, x_label: str, y_label: str, values: np.ndarray, span: tuple[float, float]) -> Plot:
    """`span` is shown at least, so that bins keep a width where all values are alike."""
    low, high = min(span[0], float(values.min())), max(span[1], float(values.max()))
    counts, edges = np.histogram(values, HISTOGRAM_BINS, (low, high))
    middles = (edges[1:] + edges[:-1]) / 2.0
    bars = Series(title.lower(), tuple(middles.tolist()), tuple(counts.astype(float).tolist()), PlotKind.BARS)
    return Plot(title, x_label, y_label, (bars,))
