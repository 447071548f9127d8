"""Figure 4 of the Clutter paper and P_D, as pictures for the page; the reporting package draws no bands.

Colours are the page's variables, as in its own plots: the object blue (`--series-1`), the background red
(`--series-2`).
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from ...factors.score_model import BIN_CENTRES, TRUNCATION, ScoreModel
from ..evaluation.reporting.plots import INK, NO_METADATA, SERIES, SIZE, STYLE, VARIABLES
from ..evaluation.reporting.svg import for_page
from .summary import SizeRates

_STYLE: dict[Any, Any] = {**STYLE, "text.color": INK}
_FINE = np.linspace(0.0, 1.0, 101)


def draw_scores(model: ScoreModel, row: int, part: int, votes: np.ndarray, key: str, label: str) -> str:
    """Mean score over occlusion with a band of one sigma, the background's beside it, and the votes below.

    Args:
        model: of which to draw one row and template.
        row, part: of the model's arrays.
        votes: (10,) behind the bins.
        key: makes ids unique on the page.
        label: what it shows, for those who cannot see it.
    """
    parameters = [model.own_parameters(part, float(occlusion)) for occlusion in _FINE]
    mean = np.array([means[row] for means, _ in parameters])
    sigma = np.array([sigmas[row] for _, sigmas in parameters])
    false, false_sigma = model.background_mean[row, part], model.background_sigma[row, part]

    def fill(figure: Figure) -> None:
        axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(4, 1))
        axes.grid(True)
        axes.fill_between(_FINE, *_band(mean, sigma), color=SERIES[0], alpha=0.2, linewidth=0)
        axes.plot(_FINE, mean, color=SERIES[0], linewidth=1.5)
        axes.fill_between([0.0, 1.0], *_band(false, false_sigma), color=SERIES[1], alpha=0.16, linewidth=0)
        axes.plot([0.0, 1.0], [false, false], color=SERIES[1], linewidth=1.5, linestyle=(0, (4, 1.4)))
        axes.axvline(TRUNCATION, color=INK, linewidth=0.9, linestyle=(0, (1.5, 1.5)))
        axes.set(ylabel="score", xlim=(-0.01, 1.01), ylim=(-0.01, 1.01))
        below.set(xlabel="occluded share", ylabel="votes", yscale="log", ylim=(0.5, 2.0 * max(float(votes.max()), 5.0)))
        voted = votes > 0.5
        below.bar(BIN_CENTRES[voted], votes[voted], width=0.09, color=SERIES[6], alpha=0.75, linewidth=0)
        below.yaxis.set_major_formatter(lambda count, _: f"{count:g}")  # matplotlib's own needs its math text
        below.yaxis.set_minor_locator(NullLocator())

    return _picture(fill, key, label)


def draw_rates(rates: Sequence[SizeRates], key: str, label: str) -> str:
    """P_D over the visible share, a curve a size, and what was counted as points, larger where there are more trials.

    `key` makes ids unique on the page; `label` says what it shows, for those who cannot see it.
    """

    def fill(figure: Figure) -> None:
        axes = figure.subplots()
        axes.grid(True)
        for rate, color in zip(rates, cycle(SERIES), strict=False):
            axes.plot(rate.share, rate.curve, color=color, linewidth=1.5)
            area = 4.0 + 26.0 * np.minimum(rate.trials / 100.0, 1.0)
            axes.scatter(rate.visible, rate.rate, s=area, color=color, linewidth=0, alpha=0.7)
        axes.set(xlabel="visible share", ylabel="detection rate", xlim=(-0.01, 1.01), ylim=(-0.01, 1.01))

    return _picture(fill, key, label)


def _band(mean: np.ndarray | float, sigma: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """One sigma to either side, within the scores that there are."""
    return np.clip(np.asarray(mean - sigma), 0.0, 1.0), np.clip(np.asarray(mean + sigma), 0.0, 1.0)


def _picture(fill: Callable[[Figure], None], key: str, label: str) -> str:
    """The figure that `fill` draws, as an `<svg>` element."""
    with rc_context({**_STYLE, "svg.hashsalt": key}):
        figure = Figure(figsize=SIZE, layout="constrained")
        fill(figure)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", transparent=True, metadata=NO_METADATA)
    return for_page(buffer.getvalue(), key, label, VARIABLES)
