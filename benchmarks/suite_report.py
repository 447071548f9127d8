"""Tables of the suite: several scenes' reports as one row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from results import table

from thingmap.mapper.evaluation.protocols import meger
from thingmap.mapper.evaluation.reporting.report import Report
from thingmap.mapper.evaluation.result import Table

LENGTHS = (3, 7, 10, 12)


@dataclass(frozen=True, slots=True)
class Column:
    """A column of the tables: the mean over scenes of one metric, times `scale`, with `digits` decimals."""

    head: str
    protocol: str
    metric: str
    scale: float = 1.0
    digits: int = 2

    def show(self, reports: Sequence[Report]) -> str:
        return _number(_mean(reports, self.protocol, self.metric), self.scale, self.digits)


OBJECT_COLUMNS = (
    Column("detection F1", "objects", "detection F1"),
    Column("joint F1", "objects", "joint F1"),
    Column("joint recall", "objects", "joint recall"),
    Column("label accuracy", "objects", "label accuracy"),
    Column("found / true", "objects", "count ratio"),
    Column("centre, mm", "objects", "centre error, median", 1.0, 0),
    Column("size, log", "objects", "size error"),
    Column("volume IoU", "objects", "volume IoU"),
    Column("ATE, mm", "trajectory", "ATE rmse", 1000.0, 0),
)
IMAGE_COLUMNS = (
    Column("single-view mAP", "georgakis", "single-view mAP"),
    Column("single-view P", "georgakis", "single-view precision"),
    Column("single-view R", "georgakis", "single-view recall"),
    Column("multi-view mAP", "georgakis", "multi-view mAP"),
    Column("multi-view P", "georgakis", "multi-view precision"),
    Column("multi-view R", "georgakis", "multi-view recall"),
    Column("point P", "georgakis", "point precision"),
    Column("point R", "georgakis", "point recall"),
    Column("point macro F", "lai", "macro F"),
    Column("Random", "lai", "Random macro F", 1.0, 3),
    Column("AllBG", "lai", "AllBG macro F"),
)
HONESTY_COLUMNS = (
    Column("class log loss", "honesty", "class log loss"),
    Column("existence Brier", "honesty", "existence Brier score"),
    Column("existence log loss", "honesty", "existence log loss"),
    Column("position NEES", "honesty", "position NEES", 1.0, 1),
    Column("size NEES", "honesty", "size NEES", 1.0, 1),
    Column("pose NEES", "honesty", "pose NEES", 1.0, 1),
)
COST_COLUMNS = (
    Column("frames/s", "cost", "frames per second", 1.0, 0),
    Column("ms a frame, mean", "cost", "mapping per frame, mean", 1.0, 0),
    Column("ms, 95 %", "cost", "mapping per frame, p95", 1.0, 0),
    Column("peak MB", "cost", "peak memory", 1.0, 0),
    Column("keyframes", "cost", "keyframes", 1.0, 0),
)
Row = tuple[tuple[str, ...], list[Report]]  # what names a row, and the reports behind it


def metric_table(names: Sequence[str], columns: Sequence[Column], rows: Sequence[Row]) -> str:
    """A row for each group of reports, means over its scenes."""
    head = [*names, "scenes", *(column.head for column in columns)]
    return table(head, [[*name, len(group), *(c.show(group) for c in columns)] for name, group in rows])


def honesty_table(names: Sequence[str], rows: Sequence[Row]) -> str:
    """As `metric_table`, with calibration errors of all scenes' claims together: a few claims cannot show them."""
    head = [*names, "scenes", "class ECE", "existence ECE", *(column.head for column in HONESTY_COLUMNS)]
    pooled = [[_number(pooled_ece(g, f"Reliability of {of}")) for of in ("class", "existence")] for _, g in rows]
    cells = [[column.show(group) for column in HONESTY_COLUMNS] for _, group in rows]
    return table(head, [[*n, len(g), *ece, *rest] for (n, g), ece, rest in zip(rows, pooled, cells, strict=True)])


def next_view_table(names: Sequence[str], rows: Sequence[Row]) -> str:
    """Recall at one false positive an image, and average precision, of all scenes' images together."""
    metrics = [f"recall at 1 FPPI after {n} views" for n in LENGTHS] + [f"AP after {n} views" for n in (2, 4, 6)]
    head = [*names, "scenes", *(f"recall@1, {n} views" for n in LENGTHS), *(f"AP, {n} views" for n in (2, 4, 6))]
    shown = []
    for name, group in rows:
        results = [result for report in group if (result := report.result("meger")) is not None]
        pooled = meger.pool(results)
        shown.append([*name, len(results), *(_number(pooled.value(metric)) for metric in metrics)])
    return table(head, shown)


def pooled_ece(reports: Sequence[Report], title: str) -> float | None:
    """Expected calibration error of all claims: the reliability tables' bins of the same probability put together."""
    bins: dict[str, np.ndarray] = {}
    for report in reports:
        for name, count, claimed, observed in _rows(report, title):
            bins[name] = bins.get(name, np.zeros(3)) + count * np.array([1.0, claimed, observed])
    if not bins:
        return None
    sums = np.array(list(bins.values()))
    return float(np.abs(sums[:, 1] - sums[:, 2]).sum() / sums[:, 0].sum())


def _rows(report: Report, title: str) -> Sequence[tuple]:
    result = report.result("honesty")
    tables: tuple[Table, ...] = result.tables if result is not None else ()
    return next((found.rows for found in tables if found.title == title), ())


def _mean(reports: Sequence[Report], protocol: str, metric: str) -> float | None:
    results = [result for report in reports if (result := report.result(protocol)) is not None]
    values = [value for result in results if (value := result.value(metric)) is not None]
    return float(np.mean(values)) if values else None


def _number(value: float | None, scale: float = 1.0, digits: int = 2) -> str:
    return "-" if value is None else f"{value * scale:.{digits}f}"
