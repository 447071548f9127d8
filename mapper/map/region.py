"""Regions of space, and how probably an uncertain point lies in one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .polygon import Polygon, lattice, probability_in_polygon


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """Axis-aligned in the map frame: `low` and `high` corner, (3,) each, metres."""

    low: np.ndarray
    high: np.ndarray

    def chord(self, origins: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First and last t, (N,) each, at which the lines `origins (N, 3) + t direction (3,)` are inside.

        Where the first is above the last, the line misses the region.
        """
        moving = np.abs(direction) > 1e-12
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (self.low - origins) / direction, (self.high - origins) / direction
        beside = (origins < self.low) | (origins > self.high)
        enter = np.where(moving, np.minimum(a, b), np.where(beside, np.inf, -np.inf))
        leave = np.where(moving, np.maximum(a, b), np.where(beside, -np.inf, np.inf))
        return enter.max(axis=1), leave.min(axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class Ball:
    """`centre` (3,) and `radius`, metres, map frame."""

    centre: np.ndarray
    radius: float

    def chord(self, origins: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As `Box.chord`; `direction` is a unit vector."""
        offset = origins - self.centre
        middle = -(offset @ direction)
        half_squared = self.radius**2 - (np.einsum("ni,ni->n", offset, offset) - middle**2)
        half = np.sqrt(np.maximum(half_squared, 0.0))
        hit = half_squared >= 0.0
        return np.where(hit, middle - half, np.inf), np.where(hit, middle + half, -np.inf)


Region = Box | Ball | Polygon


def as_region(value: object) -> Region:
    """A region from `((xmin, ymin, zmin), (xmax, ymax, zmax))`, `(centre, radius)`, the (M, 2) corners of a polygon,
    `(corners, (low, high))` with the heights between which it stands, or a region itself.

    Raises:
        ValueError: where it is none, a box is turned inside out, a radius is negative, or a polygon crosses itself.
    """
    if isinstance(value, Box | Ball | Polygon):
        return value
    expected = "a region is ((xmin, ymin, zmin), (xmax, ymax, zmax)), (centre, radius) or the corners of a polygon"
    corners = _numbers(value)
    if corners is not None and corners.shape != (2, 2) and corners.ndim == 2 and corners.shape[1] == 2:
        return Polygon(corners)
    try:
        first, second = (np.asarray(part, dtype=np.float64) for part in value)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise ValueError(f"{expected}, but got {value!r}") from None
    if first.shape == (3,) and second.shape == () and second >= 0.0:
        return Ball(first, float(second))
    if first.ndim == 2 and first.shape[1] == 2 and second.shape == (2,):
        return Polygon(first, float(second[0]), float(second[1]))
    if first.shape == (3,) and second.shape == (3,) and np.all(first <= second):
        return Box(first, second)
    raise ValueError(f"{expected} with xmin <= xmax and a radius >= 0, but got {value!r}")


def _numbers(value: object) -> np.ndarray | None:
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return None


def probability_inside(region: Region, mean: np.ndarray, covariance: np.ndarray) -> float:
    """P(x in region) for x ~ N(mean (3,), covariance (3, 3)), metres; within 0.002. For a polygon x is in the upright
    frame, otherwise in the map's.

    Boxes and balls are convex, so a line cuts them in one interval: the integral along the widest principal axis is a
    difference of two normal distribution functions. Across it, the lines stand on a Fibonacci lattice in the unit
    square, which the inverse distribution function turns into equally probable places.
    """
    from scipy.special import ndtr, ndtri

    if isinstance(region, Polygon):
        return probability_in_polygon(region, mean, covariance)
    variances, axes = np.linalg.eigh(covariance)
    stds = np.sqrt(np.maximum(variances, 0.0))
    across = ndtri(lattice()) * stds[:2]
    enter, leave = region.chord(mean + across @ axes[:, :2].T, axes[:, 2])
    if stds[2] == 0.0:
        return float(np.mean((enter <= 0.0) & (leave >= 0.0)))
    return float(np.mean(np.where(leave >= enter, ndtr(leave / stds[2]) - ndtr(enter / stds[2]), 0.0)))
