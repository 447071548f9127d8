"""Edges of a graph as arcs in both directions, listed by the node they leave."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class Arcs(NamedTuple):
    """Edge e between nodes i < j is arc 2e from i to j and arc 2e + 1 back: the other way of arc a is a ^ 1.

    The two lie side by side in every array over arcs, so that pushing flow touches one place in memory. A tuple,
    because that is what numba takes apart.

    Attributes:
        first: (N + 1,) int64, where in `leaving` each node's arcs begin.
        leaving: (2E,) int32 arcs by the node they leave, ascending for each.
        heads: (2E,) int32 the node that each arc leads to.
    """

    first: np.ndarray
    leaving: np.ndarray
    heads: np.ndarray

    @classmethod
    def of(cls, nodes: int, edges: np.ndarray) -> Arcs:
        """From (E, 2) int32 edges between `nodes` nodes."""
        heads = np.ascontiguousarray(edges[:, ::-1]).reshape(-1)
        first, leaving = _list_arcs(nodes, heads)
        return cls(first, leaving, heads)


@njit(cache=True)
def _list_arcs(nodes: int, heads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    first = np.zeros(nodes + 1, np.int64)
    for a in range(len(heads)):
        first[heads[a ^ 1] + 1] += 1
    for i in range(nodes):
        first[i + 1] += first[i]
    end = first[:-1].copy()
    leaving = np.empty(len(heads), np.int32)
    for a in range(len(heads)):
        tail = heads[a ^ 1]
        leaving[end[tail]] = a
        end[tail] += 1
    return first, leaving
