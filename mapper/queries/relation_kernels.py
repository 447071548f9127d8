"""Integrals over the draws of pairs of boxes, compiled; what they are integrals of is said where they are used.

Each takes `Drawn` and returns (P,) values. Sizes that are drawn below 0 count as 0.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .relation_draws import Drawn
from .relation_geometry import (
    horizontal_gap,
    is_over,
    is_under_first,
    shared_footprint,
    shared_height,
)

IMPOSSIBLE = 8.0  # standard deviations: a density beyond is less than 1e-13 of its largest value


@njit(cache=True)
def _half(size: float, std: float, normal: float) -> float:
    return max(size + std * normal, 0.0) / 2.0


@njit(cache=True)
def _below(value: float, std: float) -> float:
    """P(a normal variable with this standard deviation is below the value)."""
    return 0.5 * math.erfc(-value / (std * math.sqrt(2.0)))


@njit(cache=True)
def contact_density(d: Drawn, contact_std: float) -> np.ndarray:
    """E[1(first centre over second footprint) N(bottom of the first - top of the second; 0, variance)], 1 / metres."""
    result = np.zeros(len(d.mean))
    for p in range(len(d.mean)):
        root, top = d.root[p], (d.first[p, 2] + d.second[p, 2]) / 2.0
        variance = root[2, 2] ** 2 + (d.first_std[p, 2] ** 2 + d.second_std[p, 2] ** 2) / 4.0 + contact_std**2
        total = 0.0
        if abs(d.mean[p, 2] - top) > IMPOSSIBLE * math.sqrt(variance + root[2, 0] ** 2 + root[2, 1] ** 2):
            continue
        for n in d.normal:
            x, y = d.mean[p, 0] + root[0, 0] * n[0], d.mean[p, 1] + root[1, 0] * n[0] + root[1, 1] * n[1]
            bx, by = _half(d.second[p, 0], d.second_std[p, 0], n[6]), _half(d.second[p, 1], d.second_std[p, 1], n[7])
            if is_over(x, y, bx, by):
                gap = d.mean[p, 2] + root[2, 0] * n[0] + root[2, 1] * n[1] - top
                total += math.exp(-0.5 * gap * gap / variance)
        result[p] = total / len(d.normal) / math.sqrt(2.0 * math.pi * variance)
    return result


@njit(cache=True)
def under_shares(d: Drawn) -> tuple[np.ndarray, np.ndarray]:
    """P(a centre in the other's footprint and the first centre below the second's bottom), P(the same and its top below
    the second's top)."""
    solid, hollow = np.zeros(len(d.mean)), np.zeros(len(d.mean))
    for p in range(len(d.mean)):
        c, s = d.turn[p]
        root, az, bz = d.root[p], d.first[p, 2] / 2.0, d.second[p, 2] / 2.0
        bottom_std = math.sqrt(root[2, 2] ** 2 + d.second_std[p, 2] ** 2 / 4.0)
        top_std = math.sqrt(bottom_std**2 + d.first_std[p, 2] ** 2 / 4.0)
        for n in d.normal:
            x, y = d.mean[p, 0] + root[0, 0] * n[0], d.mean[p, 1] + root[1, 0] * n[0] + root[1, 1] * n[1]
            bx, by = _half(d.second[p, 0], d.second_std[p, 0], n[6]), _half(d.second[p, 1], d.second_std[p, 1], n[7])
            ax, ay = _half(d.first[p, 0], d.first_std[p, 0], n[3]), _half(d.first[p, 1], d.first_std[p, 1], n[4])
            if is_over(x, y, bx, by) or is_under_first(x, y, c, s, ax, ay):
                z = d.mean[p, 2] + root[2, 0] * n[0] + root[2, 1] * n[1]
                solid[p] += _below(-bz - z, bottom_std)
                hollow[p] += _below(bz - az - z, top_std)
    return solid / len(d.normal), hollow / len(d.normal)


@njit(cache=True)
def _boxes(d: Drawn, p: int, n: np.ndarray) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Offset of the first centre, half extents of the first and of the second, as drawn."""
    root, mean = d.root[p], d.mean[p]
    return (
        mean[0] + root[0, 0] * n[0],
        mean[1] + root[1, 0] * n[0] + root[1, 1] * n[1],
        mean[2] + root[2, 0] * n[0] + root[2, 1] * n[1] + root[2, 2] * n[2],
        _half(d.first[p, 0], d.first_std[p, 0], n[3]),
        _half(d.first[p, 1], d.first_std[p, 1], n[4]),
        _half(d.first[p, 2], d.first_std[p, 2], n[5]),
        _half(d.second[p, 0], d.second_std[p, 0], n[6]),
        _half(d.second[p, 1], d.second_std[p, 1], n[7]),
        _half(d.second[p, 2], d.second_std[p, 2], n[8]),
    )


@njit(cache=True)
def inside_share(d: Drawn, mostly: float) -> np.ndarray:
    """P(more than `mostly` (>= 0.5) of the first's volume is in the second, which is larger)."""
    result = np.zeros(len(d.mean))
    for p in range(len(d.mean)):
        c, s = d.turn[p]
        for n in d.normal:
            x, y, z, ax, ay, az, bx, by, bz = _boxes(d, p, n)
            # half of a convex body is in another one only if its centre is: the others need no cells
            if is_over(x, y, bx, by) and ax * ay * az < bx * by * bz:
                height = shared_height(z, az, bz) / max(2.0 * az, 1e-9)
                if height > mostly and height * shared_footprint(x, y, c, s, ax, ay, bx, by) > mostly:
                    result[p] += 1.0
    return result / len(d.normal)


@njit(cache=True)
def beside_share(d: Drawn, mostly: float, reach: float) -> np.ndarray:
    """P(side by side at most `reach` metres apart, at a common height); a negative reach is the boxes' mean width."""
    result = np.zeros(len(d.mean))
    for p in range(len(d.mean)):
        c, s = d.turn[p]
        for n in d.normal:
            x, y, z, ax, ay, az, bx, by, bz = _boxes(d, p, n)
            limit = math.sqrt((ax + ay) * (bx + by)) if reach < 0.0 else reach
            if shared_height(z, az, bz) <= mostly * 2.0 * min(az, bz):
                continue
            if math.hypot(x, y) > math.hypot(ax, ay) + math.hypot(bx, by) + limit:
                continue
            if is_over(x, y, bx, by) or is_under_first(x, y, c, s, ax, ay):
                continue
            result[p] += horizontal_gap(x, y, c, s, ax, ay, bx, by) <= limit
    return result / len(d.normal)


@njit(cache=True)
def gap_moments(d: Drawn) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of the horizontal gap between the boxes, metres."""
    mean, variance = np.zeros(len(d.mean)), np.zeros(len(d.mean))
    values = np.zeros(len(d.normal))
    for p in range(len(d.mean)):
        c, s = d.turn[p]
        for k in range(len(d.normal)):
            x, y, _, ax, ay, _, bx, by, _ = _boxes(d, p, d.normal[k])
            values[k] = horizontal_gap(x, y, c, s, ax, ay, bx, by)
        mean[p], variance[p] = values.mean(), values.var()
    return mean, np.sqrt(variance)
