"""Whether probabilities mean what they say: of what is claimed with 0.8, eight of ten should be so.

    expected calibration error   sum_b n_b / N |observed_b - claimed_b|      (Naeini et al. 2015; Guo et al. 2017, (3))
    maximum calibration error    max_b |observed_b - claimed_b|              (the same, (5))
    Brier score                  1/N sum_i sum_k (p_ik - y_ik)^2             (Brier 1950; from 0 to 2)
                                 1/N sum_i (p_i - y_i)^2 for yes or no       (from 0 to 1)
    log loss                     -1/N sum_i ln max(p_i(what is so), LOG_FLOOR)

over equal bins b of the probability; `claimed_b` is the mean of the probabilities in a bin, `observed_b` how often they
came true.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..result import Better, Metric, Plot, PlotKind, Series, Table

LOG_FLOOR = 1e-6  # probability below which being wrong costs no more: 13.8 at most


@dataclass(frozen=True, slots=True, eq=False)
class Reliability:
    """Claims sorted into B equal bins of [0, 1].

    Attributes:
        count: (B,) claims in each bin.
        claimed: (B,) mean probability, NaN in empty bins.
        observed: (B,) share that came true, NaN in empty bins.
    """

    count: np.ndarray
    claimed: np.ndarray
    observed: np.ndarray

    @property
    def gap(self) -> np.ndarray:
        """|observed - claimed| of the bins that are not empty."""
        return np.abs(self.observed - self.claimed)[self.count > 0]

    @property
    def expected_error(self) -> float:
        """NaN without claims."""
        filled = self.count[self.count > 0]
        return float(self.gap @ filled / filled.sum()) if len(filled) else float("nan")

    @property
    def maximum_error(self) -> float:
        """NaN without claims."""
        return float(self.gap.max()) if len(self.gap) else float("nan")


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Scores of N claims; NaN without any."""

    reliability: Reliability
    brier: float
    log_loss: float

    @property
    def count(self) -> int:
        return int(self.reliability.count.sum())


def calibrate_outcomes(probability: np.ndarray, outcome: np.ndarray, bins: int) -> Calibration:
    """Scores of claims that are true or not.

    Args:
        probability: (N,) in [0, 1], of being true.
        outcome: (N,) bool.
        bins: of the reliability diagram.
    """
    given = np.where(outcome, probability, 1.0 - probability)
    return Calibration(
        bin_claims(probability, outcome, bins), _mean((probability - outcome) ** 2), _mean(_surprise(given))
    )


def calibrate_classes(posterior: np.ndarray, true_class: np.ndarray, bins: int) -> Calibration:
    """Scores of distributions over K classes; the reliability is that of the likeliest class.

    Args:
        posterior: (N, K), rows sum to 1.
        true_class: (N,) columns.
        bins: of the reliability diagram.
    """
    rows = np.arange(len(posterior))
    named = np.argmax(posterior, axis=1) if len(posterior) else np.empty(0, dtype=np.int64)
    truth = np.zeros(posterior.shape)
    truth[rows, true_class] = 1.0
    return Calibration(
        bin_claims(posterior[rows, named], named == true_class, bins),
        _mean(np.sum((posterior - truth) ** 2, axis=1)),
        _mean(_surprise(posterior[rows, true_class])),
    )


def bin_claims(probability: np.ndarray, outcome: np.ndarray, bins: int) -> Reliability:
    """Sort claims into bins [k / bins, (k + 1) / bins); the last one holds 1 as well. Arguments as above."""
    probability = np.asarray(probability, dtype=np.float64)
    edges = np.arange(1, bins) / bins
    index = np.searchsorted(edges, probability, side="right")
    count = np.bincount(index, minlength=bins)
    with np.errstate(invalid="ignore"):
        claimed = np.bincount(index, weights=probability, minlength=bins) / count
        observed = np.bincount(index, weights=np.asarray(outcome, dtype=np.float64), minlength=bins) / count
    return Reliability(count, claimed, observed)


def calibration_metrics(name: str, result: Calibration) -> tuple[Metric, ...]:
    """ "`name` ECE" and so on."""
    values = {
        "ECE": result.reliability.expected_error,
        "MCE": result.reliability.maximum_error,
        "Brier score": result.brier,
        "log loss": result.log_loss,
    }
    metrics = [
        Metric(f"{name} {key}", value if result.count else None, "", Better.LOWER) for key, value in values.items()
    ]
    return (*metrics, Metric(f"{name} samples", result.count, "", Better.NEITHER, headline=False))


def reliability_table(title: str, reliability: Reliability) -> Table:
    """One row for each bin that is not empty."""
    bins = len(reliability.count)
    rows = [
        (f"{k / bins:.2g} to {(k + 1) / bins:.2g}", int(count), float(claimed), float(observed))
        for k, (count, claimed, observed) in enumerate(
            zip(reliability.count, reliability.claimed, reliability.observed, strict=True)
        )
        if count
    ]
    return Table(title, ("probability", "samples", "claimed", "observed"), tuple(rows))


def reliability_plot(title: str, reliability: Reliability) -> Plot:
    """Observed against claimed; the diagonal is honest."""
    filled = reliability.count > 0
    claimed, observed = reliability.claimed[filled].tolist(), reliability.observed[filled].tolist()
    series = (
        Series("honest", (0.0, 1.0), (0.0, 1.0)),
        Series("bins of the map's claims", tuple(claimed), tuple(observed), PlotKind.POINTS),
    )
    return Plot(title, "claimed probability", "observed share", series, (0.0, 1.0, 0.0, 1.0), equal=True)


def _surprise(probability: np.ndarray) -> np.ndarray:
    return -np.log(np.maximum(probability, LOG_FLOOR))


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if len(values) else float("nan")
