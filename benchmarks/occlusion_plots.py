"""Curves of the occlusion benchmark as SVG files that look the same every time: no dates, ids of a fixed salt."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from occlusion_bootstrap import CONFIDENCE
from occlusion_methods import FULL
from occlusion_report import METRICS, SHOWN, Results, titles

from thingmap.datasets.synthetic.config import ClutterLevel
from thingmap.mapper.evaluation.boxes.curves import recall_per_false_positives
from thingmap.mapper.evaluation.protocols.meger import FALSE_PER_IMAGE
from thingmap.mapper.map.atomic import make_folder, write_atomic

MOST_FALSE = 3.0  # per image, the right end of the curves
PANEL = (3.1, 2.7)  # inches
SHARES = (0.0, 1.02)  # or lines at 1 are cut in half
LOOKS = {  # colour, dashes: told apart in grey too (Wong 2011, colours for the colour-blind)
    "full": ("#000000", "-"),
    "detector": ("#d55e00", "-"),
    "no-occlusion": ("#0072b2", "--"),
    "no-depth": ("#009e73", "-."),
    "no-parts": ("#cc79a7", (0, (5, 1, 1, 1, 1, 1))),
    "detector-parts": ("#e69f00", ":"),
    "batch": ("#56b4e9", "--"),
}
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "occlusion",
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.linewidth": 0.6,
    "legend.frameon": False,
}
_NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}


def write_plots(levels: Mapping[ClutterLevel, Results], folder: Path) -> dict[str, Path]:
    """All pictures; returns "recall LEVEL" and "views" with their files. Raises `UserError` where they cannot be."""
    make_folder(folder)
    pictures = {f"recall {level}": recall_curves(results) for level, results in levels.items()}
    pictures["views"] = by_views(levels)
    files = {}
    for name, svg in pictures.items():
        files[name] = folder / f"occlusion-{name.replace(' ', '-')}.svg"
        write_atomic(files[name], svg.encode())
    return files


def recall_curves(results: Results) -> str:
    """Recall against false positives per image: a panel a number of views, a line a method."""
    with _figure(1, len(SHOWN)) as (axes, drawn):
        for panel, views in zip(axes[0], SHOWN, strict=True):
            for name in titles(results):
                if views in results[name]:
                    fppi, recall = recall_per_false_positives(results[name][views].scored)
                    shown = fppi <= MOST_FALSE
                    x, y = [0.0, *fppi[shown], MOST_FALSE], [0.0, *recall[shown]]
                    panel.step(x, [*y, y[-1]], where="post", **_look(name))
            panel.axvline(FALSE_PER_IMAGE, color="#888888", linewidth=0.8, zorder=0)
            panel.set(xlim=(0.0, MOST_FALSE), ylim=SHARES, title=f"{views} views", xlabel="false positives per image")
        axes[0, 0].set_ylabel("recall")
        _legend(axes[0, 0], results)
    return drawn[0]


def by_views(levels: Mapping[ClutterLevel, Results]) -> str:
    """Both metrics over the number of views: a row a metric, a column a level; the full model with its interval."""
    with _figure(len(METRICS), len(levels)) as (axes, drawn):
        for column, (level, results) in enumerate(levels.items()):
            for metric, title in enumerate(METRICS):
                panel = axes[metric, column]
                for name in titles(results):
                    _draw_views(panel, name, results, metric)
                panel.set(ylim=SHARES)
                if column == 0:
                    panel.set_ylabel(title)
            axes[0, column].set_title(f"{level} clutter")
            axes[-1, column].set_xlabel("views")
        _legend(axes[0, 0], next(iter(levels.values())))
    return drawn[0]


def _draw_views(panel: Axes, name: str, results: Results, metric: int) -> None:
    views = sorted(results[name])
    panel.plot(views, [results[name][n].value[metric] for n in views], marker="o", markersize=2.5, **_look(name))
    if name == FULL.name:
        tail = (1.0 - CONFIDENCE) / 2.0
        band = [np.nanquantile(results[name][n].drawn[:, metric], [tail, 1.0 - tail]) for n in views]
        panel.fill_between(views, *np.transpose(band), color=LOOKS[name][0], alpha=0.10, linewidth=0)


@contextmanager
def _figure(rows: int, columns: int) -> Iterator[tuple[np.ndarray, list[str]]]:
    """(rows, columns) axes; after the block the list holds the picture."""
    drawn: list[str] = []
    with rc_context(_STYLE):
        figure = Figure(figsize=(PANEL[0] * columns, PANEL[1] * rows + 0.35), layout="constrained")
        yield figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True), drawn
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", facecolor="white", metadata=_NO_METADATA)
    text = re.sub(r"(?<=\d\.\d\d)\d+", "", buffer.getvalue())  # a hundredth of a point is enough
    drawn.append(re.sub(r"[ \t]+$", "", text, flags=re.MULTILINE))


def _legend(axes: Axes, results: Results) -> None:
    """One for the whole figure, above it."""
    names = titles(results)
    lines = [Line2D([], [], **_look(name)) for name in names]
    axes.figure.legend(lines, list(names.values()), loc="outside upper center", ncols=len(names), fontsize=8.5)


def _look(name: str) -> dict[str, Any]:
    color, dashes = LOOKS[name]
    return {"color": color, "linestyle": dashes, "linewidth": 2.0 if name == FULL.name else 1.3}
