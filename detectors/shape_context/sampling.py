"""Which edge points are described: some of every proposal, evenly along its contours (Georgakis et al., III-A)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from .edge_map import EdgeMap

REACH = 2  # pixels between an edge point and the mask it belongs to: masks are made on a grid of every second pixel


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """S described points of an image.

    Attributes:
        points: (S,) int64, indices into the edge map, ascending.
        owner: (S,) int32, the proposal of each.
        weight: (S,) float64, how many edge points of its proposal each stands for.
    """

    points: np.ndarray
    owner: np.ndarray
    weight: np.ndarray


def edge_owners(edges: EdgeMap, labels: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """(E,) int32, the proposal that each edge point belongs to, -1 for none.

    An occluding contour belongs to the nearer thing: of the proposals within `REACH` pixels it is the one whose depth
    there is nearest to the edge's own.

    Args:
        edges: of the image.
        labels: (H, W) int32, the proposal of each pixel, -1 for none.
        depth: (H, W) metres.
    """
    return _owners(edges.rows, edges.columns, edges.depth, labels, depth)


@njit(cache=True)
def _owners(rows, columns, edge_depth, labels, depth):  # pragma: no cover
    owner = np.full(len(rows), -1, dtype=np.int32)
    height, width = labels.shape
    for i in range(len(rows)):
        best = np.inf
        for y in range(max(0, rows[i] - REACH), min(height, rows[i] + REACH + 1)):
            for x in range(max(0, columns[i] - REACH), min(width, columns[i] + REACH + 1)):
                if labels[y, x] < 0 or depth[y, x] <= 0.0:
                    continue
                away = abs(depth[y, x] - edge_depth[i])
                if away < best:
                    best, owner[i] = away, labels[y, x]
    return owner


def sample_points(edges: EdgeMap, owner: np.ndarray, most: int, most_each: int) -> Samples:
    """At most `most` points that have an owner and a depth, at most `most_each` of each proposal.

    Where there are too many, all large proposals give the same number.
    """
    usable = np.flatnonzero((owner >= 0) & (edges.depth > 0.0))
    order = usable[np.argsort(owner[usable], kind="stable")]
    if len(order) == 0:
        return Samples(np.zeros(0, np.int64), np.zeros(0, np.int32), np.zeros(0))
    _, first, number, have = np.unique(owner[order], return_index=True, return_inverse=True, return_counts=True)
    wanted = np.minimum(have, _fair_share(have, most, most_each))
    rank = np.arange(len(order)) - first[number]
    # the points at which rank * wanted / have passes a whole number: evenly along the rows
    step, before = ((rank - back) * wanted[number] // have[number] for back in (0, 1))
    chosen = step != before
    points, weight = order[chosen], (have / np.maximum(wanted, 1))[number[chosen]]
    ascending = np.argsort(points)
    points = points[ascending]
    return Samples(points, owner[points], weight[ascending])


def _fair_share(have: np.ndarray, most: int, most_each: int) -> int:
    """The largest number, up to `most_each`, of which all can have so many without there being more than `most`."""
    low, high = 0, most_each
    while low < high:
        middle = (low + high + 1) // 2
        if np.minimum(have, middle).sum() <= most:
            low = middle
        else:
            high = middle - 1
    return low
