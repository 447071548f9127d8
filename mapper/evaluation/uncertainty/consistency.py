"""Whether covariances mean what they say: the normalised estimation error squared.

    NEES_i = e_i^T Sigma_i^-1 e_i        (Bar-Shalom, Li and Kirubarajan 2001, section 5.4)

For d-dimensional Gaussian errors of the stated covariances it is chi-square with d degrees of freedom, so that the mean
per degree of freedom is near 1, and for N independent errors in [q(0.025), q(0.975)] / (N d) with probability 0.95, q
being the quantiles of chi-square with N d degrees. Above the band the covariances promise too much, below too little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincinv

from ..result import Better, Metric, Plot, PlotKind, Series

CONFIDENCE = 0.95
SINGULAR = 1e-12  # smallest to largest eigenvalue of a correlation matrix at which nothing can be divided by it


@dataclass(frozen=True, slots=True, eq=False)
class Consistency:
    """NEES of N errors with d degrees of freedom.

    Attributes:
        dof: d.
        nees: (N,) values.
        singular: how many more errors there were, whose covariance cannot be inverted.
    """

    dof: int
    nees: np.ndarray
    singular: int

    @property
    def mean_per_dof(self) -> float | None:
        """Mean NEES / d; None without errors."""
        return float(np.mean(self.nees)) / self.dof if len(self.nees) else None

    @property
    def band(self) -> tuple[float, float] | None:
        """Where `mean_per_dof` lies with probability `CONFIDENCE` if errors are independent; None without errors."""
        if not len(self.nees):
            return None
        degrees, tail = len(self.nees) * self.dof, (1.0 - CONFIDENCE) / 2.0
        low, high = chi_square_quantile(np.array([tail, 1.0 - tail]), degrees) / degrees
        return float(low), float(high)

    @property
    def inside(self) -> float | None:
        """Share of errors inside the ellipsoid that should hold `CONFIDENCE` of them."""
        limit = chi_square_quantile(np.array([CONFIDENCE]), self.dof)[0]
        return float(np.mean(self.nees <= limit)) if len(self.nees) else None

    @property
    def verdict(self) -> str | None:
        """ "too sure", "honest" or "too careful"; None without errors."""
        if self.mean_per_dof is None or self.band is None:
            return None
        low, high = self.band
        return "too sure" if self.mean_per_dof > high else "too careful" if self.mean_per_dof < low else "honest"


def measure_consistency(errors: np.ndarray, covariances: np.ndarray) -> Consistency:
    """NEES of (N, d) errors with (N, d, d) covariances. Singular covariances are counted and left out, never mended.

    Whether one is singular is seen from its correlations, so that units (radians beside metres) do not matter.
    """
    nees, singular = [], 0
    for error, covariance in zip(errors, covariances, strict=True):
        deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        if not (np.isfinite(covariance).all() and (deviation > 0.0).all()):
            singular += 1
            continue
        values, axes = np.linalg.eigh(covariance / np.outer(deviation, deviation))
        if values[0] <= SINGULAR * values[-1]:
            singular += 1
            continue
        nees.append(float(np.sum((axes.T @ (error / deviation)) ** 2 / values)))
    return Consistency(errors.shape[1], np.array(nees), singular)


def chi_square_quantile(probability: np.ndarray, dof: int) -> np.ndarray:
    """Quantiles of the chi-square distribution, by the inverse of the regularised incomplete gamma function."""
    return 2.0 * gammaincinv(dof / 2.0, probability)


def consistency_metrics(name: str, result: Consistency) -> tuple[Metric, ...]:
    """ "`name` NEES" per degree of freedom, and what belongs to it."""
    low, high = result.band or (None, None)
    return (
        Metric(f"{name} NEES", result.mean_per_dof, better=Better.NEAR_ONE),
        Metric(f"{name} NEES, low end of the 95 % band", low, better=Better.NEITHER, headline=False),
        Metric(f"{name} NEES, high end of the 95 % band", high, better=Better.NEITHER, headline=False),
        Metric(f"{name} inside the 95 % ellipsoid", result.inside, better=Better.NEITHER),
        Metric(f"{name} NEES samples", len(result.nees), better=Better.NEITHER, headline=False),
    )


def consistency_plot(name: str, result: Consistency) -> Plot:
    """Sorted NEES against the quantiles that they should be; on the line they are honest."""
    count = len(result.nees)
    expected = chi_square_quantile((np.arange(count) + 0.5) / count, result.dof)
    series = (
        Series("honest", (0.0, float(expected[-1])), (0.0, float(expected[-1]))),
        Series(name, tuple(expected.tolist()), tuple(np.sort(result.nees).tolist()), PlotKind.POINTS),
    )
    label = f"chi-square quantile, {result.dof} degrees of freedom"
    return Plot(f"NEES of {name}", label, "NEES", series)
