"""Maximum flow and minimum cut by Boykov and Kolmogorov's search trees (PAMI 26(9), 2004)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from .arcs import Arcs
from .search_trees import ACTIVE_AT, ACTIVE_LEFT, CLOCK, FREE, Trees, adopt, augment, grow, plant


class Cut(NamedTuple):
    """A minimum cut.

    Attributes:
        flow: what flows from source to sink through the given arcs: the capacity of the arcs that are cut.
        sink_side: (N,) bool, the nodes on the sink's side; of all minimum cuts the one with the fewest.
    """

    flow: float
    sink_side: np.ndarray


def minimum_cut(arcs: Arcs, capacity: np.ndarray, terminal: np.ndarray) -> Cut:
    """Cut a graph between source and sink where it holds together least.

    Args:
        arcs: of the graph without source and sink.
        capacity: (2E,) of each arc, not negative; float64 or int64. Becomes what is left of it.
        terminal: (N,) of the same type: capacity from the source to a node where positive, from the node to the sink
            where negative. (A node with both has a flow of the smaller one through it, whatever the rest: leave the
            difference.) Becomes what is left of it.

    Raises:
        ValueError: types or shapes do not fit.
    """
    if capacity.dtype != terminal.dtype or capacity.dtype not in (np.float64, np.int64):
        raise ValueError(f"capacities must be all float64 or all int64, but are {capacity.dtype} and {terminal.dtype}")
    if capacity.shape != arcs.heads.shape or len(terminal) != len(arcs.first) - 1:
        raise ValueError(f"{capacity.shape} and {terminal.shape} capacities do not fit the graph's arcs and nodes")
    flow, sink_side = _cut(arcs, capacity, terminal)
    return Cut(flow, sink_side)


@njit(cache=True)
def _cut(arcs: Arcs, capacity: np.ndarray, terminal: np.ndarray):
    flow = push_neighbours(arcs, capacity, terminal)
    trees = plant(terminal)
    state = trees.state
    while True:
        i = next_active(trees)
        if i < 0:
            break
        while trees.parent[i] != FREE:  # a node may fall out of its tree while it grows
            middle = grow(trees, arcs, capacity, i)
            if middle < 0:
                break
            state[CLOCK] += 1
            flow += augment(trees, arcs, capacity, terminal, middle)
            adopt(trees, arcs, capacity)
    sink_side = np.empty(len(terminal), np.bool_)
    for i in range(len(terminal)):
        sink_side[i] = trees.parent[i] != FREE and trees.sink[i]
    return flow, sink_side


@njit(cache=True)
def push_neighbours(arcs: Arcs, capacity: np.ndarray, terminal: np.ndarray):
    """Flow from each node with some left from the source straight to neighbours with some left to the sink.

    Any path may be taken first, and these need no trees.
    """
    flow = np.zeros(1, terminal.dtype)[0]
    for a in range(len(capacity)):
        i, j = arcs.heads[a ^ 1], arcs.heads[a]
        if capacity[a] > 0 and terminal[i] > 0 and terminal[j] < 0:
            pushed = min(capacity[a], terminal[i], -terminal[j])
            capacity[a] -= pushed
            capacity[a ^ 1] += pushed
            terminal[i] -= pushed
            terminal[j] += pushed
            flow += pushed
    return flow


@njit(cache=True)
def next_active(trees: Trees):
    """The node that has waited longest to grow, or -1."""
    state = trees.state
    while state[ACTIVE_LEFT] > 0:
        i = trees.active[state[ACTIVE_AT]]
        state[ACTIVE_AT] = (state[ACTIVE_AT] + 1) % len(trees.active)
        state[ACTIVE_LEFT] -= 1
        trees.waiting[i] = False
        if trees.parent[i] != FREE:
            return i
    return -1
