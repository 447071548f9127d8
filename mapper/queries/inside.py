"""The probability that uncertain points lie in a region, for many at once and with no more work than is needed."""

from __future__ import annotations

import numpy as np

from ..map.region import Ball, Box, probability_inside
from .inside_bounds import inside_bounds
from .narrow_ball import narrow_in_ball

AGREE = 1e-4  # bounds that are this close are an answer: integrals are within 0.002
INTEGRAL_ERROR = 0.004  # twice what `probability_inside` is within


def inside_or_nan(region: Box | Ball, means: np.ndarray, covariances: np.ndarray, least: np.ndarray) -> np.ndarray:
    """P(x_n in region), (N,), for x_n ~ N(mean_n, covariance_n); NaN where it is surely below `least`.

    Bounds come first; what they leave open is integrated, quickly where the point is much surer than a ball is wide.

    Args:
        region: map frame, metres.
        means: (N, 3) metres.
        covariances: (N, 3, 3) square metres.
        least: (N,) probabilities that are of interest.
    """
    lower, upper = inside_bounds(region, means, covariances)
    inside = np.where(upper - lower <= AGREE, (lower + upper) / 2.0, np.nan)
    possible = (upper >= least - INTEGRAL_ERROR) & (upper > 0.0)
    inside[~possible] = np.nan
    if isinstance(region, Ball):
        rest = np.flatnonzero(possible & np.isnan(inside))
        inside[rest] = narrow_in_ball(region, means[rest], covariances[rest])
    for n in np.flatnonzero(possible & np.isnan(inside)).tolist():
        inside[n] = probability_inside(region, means[n], covariances[n])
    return inside
