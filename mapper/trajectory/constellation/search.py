"""The search for corrections that lay many recent things on old ones at once.

Instead of one largest clique of the graph of consistent pairs, where the toss of a threshold decides, every edge is
grown into a set of pairs by the correction that it gives, the most promising edges first: ambiguous places have several
good answers, and all of them are wanted.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

MAX_GROWN = 200  # edges that are tried; sets grown earlier cover most others
GROWING_STEPS = 4  # fits of correction and set in turn; more hardly ever change the set
GROWTH = 10.0  # nats, more than a set gains after the first step, when pairs beside the edge's neighbours may join
WINDOW = 25.0  # nats below the best set from which on others do not matter


@njit(cache=True)
def grow_sets(recent, old, pairs, gain, variance, joined, edges, bounds, tilt, gate, baseline, fewest, least, wanted):
    """Sets of pairs that one correction fulfils, no thing twice.

    Args:
        recent, old, pairs, gain, variance, joined, tilt, gate: as in `constellation_graph`.
        edges, bounds: of `edges_with_bounds`, best first.
        baseline: metres, shortest horizontal distance that gives a direction.
        fewest: pairs of a set.
        least: nats that a set must gain.
        wanted: most sets.

    Returns:
        (S, N) index of the pair that each recent thing is in, or -1.
    """
    sets = np.full((wanted, len(recent)), -1, dtype=np.int64)
    members = np.empty(len(recent), dtype=np.int64)
    found, grown = 0, 0
    for e in range(len(edges)):
        if grown == MAX_GROWN or found == wanted or bounds[e] < least:
            break
        p, q = edges[e]
        i, k = pairs[p, 0], pairs[q, 0]
        short = math.hypot(recent[k, 0] - recent[i, 0], recent[k, 1] - recent[i, 1]) < baseline
        if short or _known(sets, found, i, p, k, q):
            continue
        grown += 1
        members[:] = -1
        members[i], members[k] = p, q
        allowed = joined[p] & joined[q]
        allowed[p] = allowed[q] = True
        total = 0.0
        for _ in range(GROWING_STEPS):
            correction = _upright_correction(recent, old, pairs, variance, members)
            total = _choose(recent, old, pairs, gain, variance, tilt, gate, correction, allowed, members)
            if np.sum(members >= 0) < 2 or total < least - GROWTH:
                break
            allowed[:] = True
        if np.sum(members >= 0) < fewest or total < least or _same(sets, found, members):
            continue
        sets[found] = members
        found += 1
        least = max(least, total - WINDOW)
    return sets[:found]


@njit(cache=True)
def _known(sets, found, i, p, k, q):
    for s in range(found):  # noqa: SIM110 -- numba knows no `any` of a generator
        if sets[s, i] == p and sets[s, k] == q:
            return True
    return False


@njit(cache=True)
def _same(sets, found, members):
    for s in range(found):  # noqa: SIM110
        if np.all(sets[s] == members):
            return True
    return False


@njit(cache=True)
def _upright_correction(recent, old, pairs, variance, members):
    """Weighted least squares in yaw and translation: (cos, sin), both means, and their variances.

    Returns:
        cos, sin, (3,) mean of the recent things, (3,) of the old ones, (3,) variances: of the yaw, and of the mean
        along a horizontal axis and upwards.
    """
    total = np.zeros(2)
    mean_recent, mean_old = np.zeros(3), np.zeros(3)
    for p in members:
        if p >= 0:
            for axis in range(3):
                weight = 1.0 / variance[p, axis // 2]
                mean_recent[axis] += weight * recent[pairs[p, 0], axis]
                mean_old[axis] += weight * old[pairs[p, 1], axis]
            total += 1.0 / variance[p]
    for axis in range(3):
        mean_recent[axis] /= total[axis // 2]
        mean_old[axis] /= total[axis // 2]
    along, across, lever = 0.0, 0.0, 0.0
    for p in members:
        if p >= 0:
            a, b = recent[pairs[p, 0]] - mean_recent, old[pairs[p, 1]] - mean_old
            weight = 1.0 / variance[p, 0]
            along += weight * (a[0] * b[0] + a[1] * b[1])
            across += weight * (a[0] * b[1] - a[1] * b[0])
            lever += weight * (a[0] * a[0] + a[1] * a[1])
    yaw = math.atan2(across, along)
    variances = np.array([1.0 / max(lever, 1e-9), 1.0 / total[0], 1.0 / total[1]])
    return math.cos(yaw), math.sin(yaw), mean_recent, mean_old, variances


@njit(cache=True)
def _choose(recent, old, pairs, gain, variance, tilt, gate, correction, allowed, members):
    """Fills `members` with the pairs that a correction fulfils, best first, no thing twice; returns nats."""
    cos, sin, mean_recent, mean_old, variances = correction
    worth = np.zeros(len(pairs))
    for p in range(len(pairs)):
        if not allowed[p]:
            continue
        i, j = pairs[p]
        # scalars: arrays as small as these would cost more than all the rest
        ax, ay = recent[i, 0] - mean_recent[0], recent[i, 1] - mean_recent[1]
        x = cos * ax - sin * ay - (old[j, 0] - mean_old[0])
        y = sin * ax + cos * ay - (old[j, 1] - mean_old[1])
        level = ax * ax + ay * ay
        misfit = (x * x + y * y) / (variance[p, 0] + variances[1] + level * variances[0])
        if misfit > gate:
            continue
        z = recent[i, 2] - mean_recent[2] - (old[j, 2] - mean_old[2])
        misfit += z * z / (variance[p, 1] + variances[2] + tilt * tilt * level)
        if misfit < gate:
            worth[p] = gain[p] - 0.5 * misfit
    fulfilled = np.flatnonzero(worth > 0.0)
    taken = np.zeros(len(old), dtype=np.bool_)
    members[:] = -1
    total = 0.0
    for p in fulfilled[np.argsort(-worth[fulfilled])]:
        i, j = pairs[p]
        if members[i] < 0 and not taken[j]:
            members[i], taken[j] = p, True
            total += worth[p]
    return total
