"""Pairs of trajectory errors, with and without objects: is there a difference, and how large?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from results import table
from scipy.stats import wilcoxon

CONFIDENCE = 0.95
DRAWS = 10_000  # of scenes, for the interval of a mean


@dataclass(frozen=True, slots=True)
class Paired:
    """Differences d of pairs.

    Attributes:
        mean: of d.
        low, high: where the mean lies with `CONFIDENCE`, by drawing pairs anew (percentile bootstrap).
        p: two-sided, of Wilcoxon's signed-rank test that d is symmetric about 0; 1 where all are 0.
        positive: how many are above 0.
    """

    mean: float
    low: float
    high: float
    p: float
    positive: int

    @property
    def verdict(self) -> str:
        """Interval and test have to agree."""
        if self.p < 1.0 - CONFIDENCE and self.low > 0.0:
            return "yes"
        return "they harm" if self.p < 1.0 - CONFIDENCE and self.high < 0.0 else "not shown"


def compare(differences: np.ndarray, seed: int = 0) -> Paired:
    """Of (N,) differences of independent pairs."""
    d = np.asarray(differences, dtype=float)
    drawn = np.random.default_rng(seed).choice(d, (DRAWS, len(d))).mean(axis=1)
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = np.quantile(drawn, [tail, 1.0 - tail])
    p = float(np.asarray(wilcoxon(d))[1]) if np.any(d != 0.0) else 1.0
    return Paired(float(d.mean()), float(low), float(high), p, int(np.sum(d > 0.0)))


def describe(pairs: Mapping[str, np.ndarray], left_out: Sequence[str]) -> str:
    """Markdown of (scenes, 2) ATE with and without objects, metres, by condition."""
    rows = []
    for title, ate in pairs.items():
        result, median = compare(ate[:, 1] - ate[:, 0]), 1e3 * np.median(ate, axis=0)
        mean = 1e3 * ate.mean(axis=0)
        low, high = 1e3 * result.low, 1e3 * result.high
        rows.append(
            [
                title,
                len(ate),
                *(f"{m:.1f} ({q:.1f})" for m, q in zip(mean, median, strict=True)),
                f"{1e3 * result.mean:+.2f} [{low:+.2f}, {high:+.2f}]",
                f"{result.positive} of {len(ate)}",
                f"{result.p:.2g}",
                result.verdict,
            ]
        )
    head = ["condition", "scenes", "with, mm", "without, mm", "gain, mm", "better in", "p", "do they help?"]
    text = (
        "ATE in mm, aligned by SE(3), of the same scenes mapped with and without what objects say about the camera: "
        f"mean (median) over scenes. Gain: mean of the paired differences with its {CONFIDENCE:.0%} interval by "
        f"{DRAWS} draws of scenes; p of Wilcoxon's signed-rank test, two-sided, each condition by itself. 'yes' and "
        "'they harm' need both to say so."
    )
    absent = "".join(f"\n\nNot measured: {why}." for why in left_out)
    return f"{text}\n\n{table(head, rows)}{absent}"
