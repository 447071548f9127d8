"""An upright prism over a polygon of the floor plan, and how probably an uncertain point lies in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LINES, GENERATOR = 2584, 1597  # neighbours in Fibonacci's sequence: they make an even lattice of the unit square


@dataclass(frozen=True, slots=True, eq=False)
class Polygon:
    """What stands over a polygon of the floor plan.

    Attributes:
        corners: (M, 2) x and y in the upright frame (`ObjectMap.R_world_upright`), metres, M >= 3, going round either
            way; the last is joined with the first. It may have dents, but its sides do not cross.
        low, high: metres along up in the same frame, between which it stands; everything by default.

    Raises:
        ValueError: where it is not so; it says what was found.
    """

    corners: np.ndarray
    low: float = -np.inf
    high: float = np.inf

    def __post_init__(self) -> None:
        corners = np.array(self.corners, dtype=np.float64)
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3 or not np.all(np.isfinite(corners)):
            raise ValueError(f"a polygon has at least 3 corners of two finite numbers, but got {corners.tolist()}")
        if np.isnan(self.low) or np.isnan(self.high) or self.low > self.high:
            raise ValueError(f"a polygon stands between low <= high, but got {self.low} and {self.high}")
        _check_simple(corners)
        corners.setflags(write=False)
        object.__setattr__(self, "corners", corners)


def lattice() -> np.ndarray:
    """(LINES, 2) even points of the unit square."""
    number = np.arange(LINES)
    return np.stack([number + 0.5, number * GENERATOR % LINES + 0.5], axis=1) / LINES


def probability_in_polygon(region: Polygon, mean: np.ndarray, covariance: np.ndarray) -> float:
    """P(x in region) for x ~ N(mean (3,), covariance (3, 3)), upright frame, metres; within 0.002.

    The height is drawn first, from what lies between `low` and `high`; given the height the horizontal place is
    Gaussian too. Along the wider of its axes the integral is exact: a line that runs through a polygon enters and
    leaves it by turns, and the sign of the side that it crosses says which, so the share inside is a signed sum of
    normal distribution functions. Height and place across stand on an even lattice.
    """
    from scipy.special import ndtr, ndtri

    std = float(np.sqrt(max(covariance[2, 2], 0.0)))
    bounds = np.array([region.low, region.high]) - mean[2]
    low, high = ndtr(bounds / std) if std > 0.0 else (bounds > 0.0).astype(np.float64) + (bounds == 0.0) * [0.0, 1.0]
    if high <= low:
        return 0.0
    uniform = lattice()
    height = ndtri(np.clip(low + uniform[:, 0] * (high - low), 1e-300, 1.0 - 1e-16)) if std > 0.0 else np.zeros(LINES)
    slope = covariance[:2, 2] / std if std > 0.0 else np.zeros(2)
    variances, axes = np.linalg.eigh(covariance[:2, :2] - np.outer(slope, slope))
    narrow, wide = np.sqrt(np.maximum(variances, 0.0))
    origins = mean[:2] + height[:, None] * slope + (ndtri(uniform[:, 1]) * narrow)[:, None] * axes[:, 0]
    return float((high - low) * np.mean(_share_of_lines(region.corners, origins, axes[:, 1], float(wide))))


def _share_of_lines(corners: np.ndarray, origins: np.ndarray, direction: np.ndarray, std: float) -> np.ndarray:
    """(N,) P(origin + t direction inside) for t ~ N(0, std^2) on every line; `direction` (2,) is a unit vector."""
    from scipy.special import ndtr

    # in the lines' own axes: `aside` is across them, `ahead` along them
    normal = np.array([-direction[1], direction[0]])
    aside, ahead = corners @ normal, corners @ direction
    share = np.zeros(len(origins))
    across, along = origins @ normal, origins @ direction
    orientation = np.sign(_twice_area(corners))
    for k in range(len(corners)):
        a, b = aside[k - 1], aside[k]
        if a == b:
            continue  # a side that runs along the lines: none crosses it
        crossed = (across >= min(a, b)) & (across < max(a, b))
        t = ahead[k - 1] + (across - a) / (b - a) * (ahead[k] - ahead[k - 1]) - along
        before = ndtr(-t / std) if std > 0.0 else (t <= 0.0).astype(np.float64)  # P(the point is beyond the side)
        share += np.where(crossed, np.sign(a - b) * orientation * before, 0.0)
    return np.clip(share, 0.0, 1.0)


def _twice_area(corners: np.ndarray) -> float:
    x, y = corners.T
    return float(np.sum(np.roll(x, 1) * y - x * np.roll(y, 1)))


def _check_simple(corners: np.ndarray) -> None:
    """Raise `ValueError` where two sides that are not neighbours meet, or all corners lie on one line."""
    count = len(corners)
    if abs(_twice_area(corners)) < 1e-12:
        raise ValueError(f"a polygon must have an area, but got {corners.tolist()}")
    start, end = corners, np.roll(corners, -1, axis=0)
    i, j = np.triu_indices(count, 2)
    apart = ~((i == 0) & (j == count - 1))
    i, j = i[apart], j[apart]
    sides = [_side_of(start[i], end[i], p[j]) for p in (start, end)] + [
        _side_of(start[j], end[j], p[i]) for p in (start, end)
    ]
    crossing = (sides[0] * sides[1] <= 0) & (sides[2] * sides[3] <= 0)
    if np.any(crossing & ~np.all(np.equal(sides, 0), axis=0)):
        k = int(np.flatnonzero(crossing)[0])
        raise ValueError(f"sides {i[k]} and {j[k]} of a polygon meet; give its corners in order, going round")


def _side_of(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
    """(K,) 1 where p is to the left of the line from a to b, -1 to its right, 0 on it."""
    d, e = b - a, p - a
    return np.sign(d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0])
