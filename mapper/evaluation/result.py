"""What a protocol answers: numbers, tables, curves and cases, in a form that any report can show."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np

VERSION = "1.0"  # of the protocols; it changes whenever a number of an unchanged map would


class NotEvaluated(Exception):
    """Raised by a protocol for which the truth or the run lacks something; the message says what, for people."""


class Better(StrEnum):
    """Which way a number improves."""

    HIGHER = "higher"
    LOWER = "lower"
    NEAR_ONE = "near one"
    NEITHER = "neither"


class PlotKind(StrEnum):
    """How a series is drawn."""

    LINE = "line"
    STEP = "step"
    POINTS = "points"
    BARS = "bars"


@dataclass(frozen=True, slots=True)
class Metric:
    """One number: a stable `name` ("joint F1"), its value (None: undefined here), unit ("" for shares).

    What only helps to read another number is no `headline`: reports and comparisons hold it, summaries do not show it.
    """

    name: str
    value: float | int | None
    unit: str = ""
    better: Better = Better.HIGHER
    headline: bool = True


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of text, numbers or None (shown as a dash); the first column names the row.

    Pages show a `folded` one on demand only: it is there for programs.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | float | int | None, ...], ...]
    folded: bool = False


@dataclass(frozen=True, slots=True)
class Series:
    """Points of a curve; for bars `x` are the middles."""

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    kind: PlotKind = PlotKind.LINE


@dataclass(frozen=True, slots=True)
class Plot:
    """A picture of curves. `limits` is (x low, x high, y low, y high), None to fit; `equal` keeps x and y alike."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    limits: tuple[float, float, float, float] | None = None
    equal: bool = False


@dataclass(frozen=True, slots=True)
class WorstCase:
    """Something that went wrong, to be shown: text, and where it can be seen.

    Attributes:
        text: what is wrong, for people.
        frame: index into the truth's frames, None where there is no picture.
        truth_xyxy: pixels (pixel centres at integers), None where nothing true is there.
        found_xyxy: pixels, None where nothing was found.
    """

    text: str
    frame: int | None = None
    truth_xyxy: tuple[float, float, float, float] | None = None
    found_xyxy: tuple[float, float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class ProtocolResult:
    """The answer of one protocol.

    Attributes:
        protocol: stable key, such as "objects".
        title: for people.
        follows: the paper and section it follows, or what it defines itself.
        metrics: headline numbers, names unique within the protocol.
        tables, plots, worst: details.
        notes: what a reader of the numbers must know (thresholds, what was left out and why).
    """

    protocol: str
    title: str
    follows: str
    metrics: tuple[Metric, ...]
    tables: tuple[Table, ...] = ()
    plots: tuple[Plot, ...] = ()
    worst: tuple[WorstCase, ...] = ()
    notes: tuple[str, ...] = ()

    def value(self, name: str) -> float | int | None:
        """Value of the metric called `name`; KeyError where there is none."""
        for metric in self.metrics:
            if metric.name == name:
                return metric.value
        raise KeyError(name)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; NaN and infinities become None."""
        return _plain(asdict(self))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
