"""Which pairs (recent thing, old thing) one correction can fulfil together.

A pair that may be one thing is a vertex; two are joined where a correction by yaw and translation can fulfil both, that
is where horizontal distance and height difference of the recent things are those of the old ones (pairwise consistency,
Mangelson et al., ICRA 2018).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True)
def consistent_pairs(recent, old, pairs, variance, tilt, gate):
    """(P, P) bool, which pairs one correction can fulfil together.

    Args:
        recent, old: (N, 3), (M, 3) metres, z up.
        pairs: (P, 2) indices into both.
        variance: (P, 2) of a pair's difference along a horizontal axis and along up, square metres.
        tilt: rad, deviation of the correction from upright.
        gate: chi-square.
    """
    count = len(pairs)
    joined = np.zeros((count, count), dtype=np.bool_)
    between_recent, between_old = _horizontal_distances(recent), _horizontal_distances(old)
    for p in range(count):
        i, j = pairs[p]
        for q in range(p + 1, count):
            k, m = pairs[q]
            distance = between_recent[i, k]
            apart = distance - between_old[j, m]
            level = variance[p, 0] + variance[q, 0]
            if i == k or j == m or apart * apart > gate * level:
                continue
            height = (recent[k, 2] - recent[i, 2]) - (old[m, 2] - old[j, 2])
            upright = variance[p, 1] + variance[q, 1] + (tilt * distance) ** 2
            if apart * apart / level + height * height / upright < gate:
                joined[p, q] = joined[q, p] = True
    return joined


@njit(cache=True)
def _horizontal_distances(places):
    distances = np.zeros((len(places), len(places)))
    for i in range(len(places)):
        for k in range(i):
            distances[i, k] = math.hypot(places[k, 0] - places[i, 0], places[k, 1] - places[i, 1])
            distances[k, i] = distances[i, k]
    return distances


@njit(cache=True)
def edges_with_bounds(joined, pairs, gain):
    """Every edge and the most that a set with both its pairs can gain.

    Args:
        joined: (P, P) of `consistent_pairs`.
        pairs: (P, 2), in the order of the recent things.
        gain: (P,) nats, positive.

    Returns:
        (E, 2) edges and (E,) nats: both gains and, of each other recent thing, the best pair joined to both.
    """
    edges, bounds = [(0, 0) for _ in range(0)], [0.0 for _ in range(0)]
    for p in range(len(pairs)):
        around = np.flatnonzero(joined[p])
        for q in around:
            if q < p:
                continue
            bound, thing, best = gain[p] + gain[q], -1, 0.0
            for x in around:
                if not joined[q, x]:
                    continue
                if pairs[x, 0] != thing:
                    bound, thing, best = bound + best, pairs[x, 0], 0.0
                best = max(best, gain[x])
            edges.append((p, int(q)))
            bounds.append(bound + best)
    table = np.empty((len(edges), 2), dtype=np.int64)
    for e in range(len(edges)):
        table[e] = edges[e]
    return table, np.array(bounds)
