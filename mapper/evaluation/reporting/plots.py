"""Curves as small SVG pictures for the page: no fonts, no dates, no addresses, colours left to the page's style.

Matplotlib lays them out. Words stay text in the page's own font, and every colour becomes a CSS variable (`--ink`,
`--grid`, `--series-1` ...) so that one picture serves light, dark and paper.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..result import Plot, PlotKind, Series
from .svg import for_page

SIZE = (4.4, 3.1)  # inches of 72 user units
SQUARE = (4.4, 3.9)  # where x and y are alike
MOST_POINTS = 1500  # markers drawn of one series
DASHES = ("", "6 2", "2 2", "7 2 2 2")  # differ where colours cannot: on paper, and for the colour-blind
MARKERS = ("o", "x", "^", "+")
COLORS = 7  # variables --series-1 ... of the style sheet, in an order that the colour-blind can tell apart

INK, GRID = "#010203", "#010204"  # stand-ins that no palette has; replaced by variables after drawing
SERIES = tuple(f"#0102{16 + number:02x}" for number in range(COLORS))
VARIABLES = {INK: "--ink", GRID: "--grid"} | {c: f"--series-{n}" for n, c in enumerate(SERIES, start=1)}
STYLE = {
    "svg.fonttype": "none",
    "text.parse_math": False,  # a label may hold a dollar sign
    "font.size": 9.0,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "axes.formatter.useoffset": False,
    "path.simplify_threshold": 0.2,  # pixels at 72 to the inch
}
NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}


@dataclass(frozen=True, slots=True)
class LegendEntry:
    """How one series is told from the others.

    `color` counts from 1, `dashes` is an SVG dash array ("" for solid), `marker` one of `MARKERS`.
    """

    name: str
    kind: PlotKind
    color: int
    dashes: str
    marker: str


def legend(plot: Plot) -> tuple[LegendEntry, ...]:
    """An entry a series, in order; the page writes it below the picture, where it covers nothing."""
    return tuple(
        LegendEntry(_shown_name(series), series.kind, number % COLORS + 1, _dashes(number), _marker(number))
        for number, series in enumerate(plot.series)
    )


def draw(plot: Plot, key: str) -> str | None:
    """The picture as an `<svg>` element; None where no series has a point to show.

    `key` makes ids unique on the page and the same every time: letters, digits and hyphens.
    """
    if not any(_finite(series).any() for series in plot.series):
        return None
    style: dict[Any, Any] = {**STYLE, "svg.hashsalt": key}
    with rc_context(style):
        figure = Figure(figsize=SQUARE if plot.equal else SIZE, layout="constrained")
        axes = figure.subplots()
        axes.grid(True)
        for number, series in enumerate(plot.series):
            _draw_series(axes, series, number, list(_bars_beside(plot)))
        _frame(axes, plot)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", transparent=True, metadata=NO_METADATA)
    label = f"{plot.title}: {plot.y_label} over {plot.x_label}"
    return for_page(buffer.getvalue(), key, label, VARIABLES)


def _frame(axes: Axes, plot: Plot) -> None:
    axes.set_xlabel(plot.x_label)
    axes.set_ylabel(plot.y_label)
    axes.margins(0.04)
    shown = [(series, _finite(series)) for series in plot.series]
    x = np.concatenate([np.asarray(series.x, dtype=np.float64)[finite] for series, finite in shown])
    y = np.concatenate([np.asarray(series.y, dtype=np.float64)[finite] for series, finite in shown])
    bars = any(_bars_beside(plot))
    if plot.limits is not None:
        low_x, high_x, low_y, high_y = plot.limits
        pad_x, pad_y = 0.01 * (high_x - low_x), 0.01 * (high_y - low_y)  # or lines on the border are cut in half
        axes.set_xlim(low_x - pad_x, high_x + pad_x)
        axes.set_ylim(low_y - pad_y, high_y + pad_y)
    elif not plot.equal:
        for values, set_limits in ((x, None if bars else axes.set_xlim), (y, axes.set_ylim)):
            if set_limits is not None and values.min() == values.max():  # one value: from zero to it
                set_limits(*_about(float(values[0])))
    if _whole(x) and np.ptp(x) >= 2.0:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if bars and _whole(y) and plot.limits is None:  # counts: there is no half of a thing
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    if plot.equal:
        axes.set_aspect("equal", adjustable="box" if plot.limits is not None else "datalim")


def _about(value: float) -> tuple[float, float]:
    """Limits that show zero and the value; zero and one for zero."""
    end = 1.05 * (value or 1.0)
    return min(end, -0.04 * abs(end)), max(end, 0.04 * abs(end))


def _whole(values: np.ndarray) -> bool:
    return bool(np.all(values == np.round(values)))


def _draw_series(axes: Axes, series: Series, number: int, bars: list[Series]) -> None:
    color = SERIES[number % COLORS]
    x, y = np.asarray(series.x, dtype=np.float64), np.asarray(series.y, dtype=np.float64)
    if series.kind is PlotKind.BARS:
        width = (1.0 if len(bars) == 1 else 0.88) * _bar_width(bars) / len(bars)
        beside = (_index(bars, series) - 0.5 * (len(bars) - 1)) * width
        axes.bar(x + beside, y, width=0.92 * width, color=color, alpha=0.75, linewidth=0)
    elif series.kind is PlotKind.POINTS:
        step = _thinning(series)
        marker = _marker(number)
        size, edge = (3.5, 0.0) if marker in "o^" else (5.0, 1.2)
        axes.plot(x[::step], y[::step], marker, color=color, markersize=size, markeredgewidth=edge, alpha=0.85)
    else:
        drawn = "steps-post" if series.kind is PlotKind.STEP else "default"  # y holds until the next x
        dashes = _dashes(number)
        style = (0, tuple(float(part) / 1.5 for part in dashes.split())) if dashes else "-"
        lonely = "o" if _finite(series).sum() == 1 else None  # a line of one point would not show
        axes.plot(x, y, color=color, linewidth=1.5, linestyle=style, drawstyle=drawn, marker=lonely, markersize=3.2)


def _bars_beside(plot: Plot) -> Iterator[Series]:
    return (series for series in plot.series if series.kind is PlotKind.BARS)


def _index(bars: list[Series], series: Series) -> int:
    return next(number for number, other in enumerate(bars) if other is series)


def _bar_width(bars: list[Series]) -> float:
    """Room for the bars of one x: the smallest distance between two."""
    middles = np.unique(np.concatenate([np.asarray(series.x, dtype=np.float64) for series in bars]))
    gaps = np.diff(middles[np.isfinite(middles)])
    return float(gaps.min()) if len(gaps) else 1.0


def _finite(series: Series) -> np.ndarray:
    return np.isfinite(np.asarray(series.x, dtype=np.float64)) & np.isfinite(np.asarray(series.y, dtype=np.float64))


def _dashes(number: int) -> str:
    """4 dash patterns and 7 colours: 28 series differ."""
    return DASHES[number % len(DASHES)]


def _marker(number: int) -> str:
    return MARKERS[number % len(MARKERS)]


def _thinning(series: Series) -> int:
    return -(-len(series.x) // MOST_POINTS) if series.kind is PlotKind.POINTS and series.x else 1


def _shown_name(series: Series) -> str:
    if not _finite(series).any():
        return f"{series.name} (no values)"
    step = _thinning(series)
    return series.name if step == 1 else f"{series.name} (1 of {step} points shown)"
