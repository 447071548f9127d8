"""The two search trees of Boykov and Kolmogorov's maximum flow (PAMI 26(9), 2004): growing, augmenting, adopting.

A tree of nodes that residual arcs reach from the source grows towards one of nodes that reach the sink. Where they
touch there is a path; flow is pushed along it, and nodes whose arc to their parent is used up become orphans that look
for another parent in their tree. Trees are kept from path to path: on the short paths of labelling problems that is
what makes the method fast.

All numbers that change live in arrays, so that the functions can share them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from .arcs import Arcs

FREE, TERMINAL, ORPHAN = -1, -2, -3
"""In place of an arc to the parent: in no tree; the parent is the source or the sink; it has to be found."""

CLOCK, ACTIVE_AT, ACTIVE_LEFT, ORPHANS_AT, ORPHANS_LEFT = range(5)
FAR = 2**31 - 1


class Trees(NamedTuple):
    """What is known of each node, and the two queues.

    Attributes:
        parent: (N,) int32, arc to the parent, or one of the three numbers above.
        sink: (N,) bool, whether it is in the sink's tree; of nodes in a tree.
        distance: (N,) int32, arcs to the terminal, as known at
        seen: (N,) int32, the clock's time then. The clock counts paths.
        active: (N,) int32, ring of the nodes that may have somewhere to grow, each once.
        waiting: (N,) bool, whether a node is in that ring.
        orphans: (N,) int32, ring of the orphans, each once.
        state: (5,) int64, the clock, and where each ring begins and how many it holds.
    """

    parent: np.ndarray
    sink: np.ndarray
    distance: np.ndarray
    seen: np.ndarray
    active: np.ndarray
    waiting: np.ndarray
    orphans: np.ndarray
    state: np.ndarray


@njit(cache=True)
def plant(terminal: np.ndarray) -> Trees:
    """Trees of the nodes that are joined to the source (positive `terminal`) or the sink (negative) by what is left."""
    n = len(terminal)
    parent, sink = np.full(n, FREE, np.int32), np.zeros(n, np.bool_)
    distance, seen = np.zeros(n, np.int32), np.zeros(n, np.int32)
    active, waiting = np.empty(n, np.int32), np.zeros(n, np.bool_)
    orphans, state = np.empty(n, np.int32), np.zeros(5, np.int64)
    trees = Trees(parent, sink, distance, seen, active, waiting, orphans, state)
    for i in range(n):
        if terminal[i] != 0:
            parent[i], sink[i], distance[i] = TERMINAL, terminal[i] < 0, 1
            activate(trees, i)
    return trees


@njit(cache=True)
def activate(trees: Trees, i) -> None:
    """Let node i grow later, unless it waits already."""
    if trees.waiting[i]:
        return
    trees.waiting[i] = True
    at = trees.state[ACTIVE_AT] + trees.state[ACTIVE_LEFT]
    trees.active[at if at < len(trees.active) else at - len(trees.active)] = i
    trees.state[ACTIVE_LEFT] += 1


@njit(cache=True)
def grow(trees: Trees, arcs: Arcs, capacity: np.ndarray, i) -> int:
    """Take free neighbours of i into its tree; the arc from the source's tree to the sink's where they touch, or -1."""
    parent, sink, distance, seen = trees.parent, trees.sink, trees.distance, trees.seen
    towards = 1 if sink[i] else 0  # flow would leave i in the source's tree, and come to i in the sink's
    for at in range(arcs.first[i], arcs.first[i + 1]):
        a = arcs.leaving[at]
        if capacity[a ^ towards] <= 0:
            continue
        j = arcs.heads[a]
        if parent[j] == FREE:
            parent[j], sink[j] = a ^ 1, sink[i]
            distance[j], seen[j] = distance[i] + 1, seen[i]
            activate(trees, j)
        elif sink[j] != sink[i]:
            return a ^ towards
        elif seen[j] <= seen[i] and distance[j] > distance[i] + 1:  # a shorter way to the terminal
            parent[j], distance[j], seen[j] = a ^ 1, distance[i] + 1, seen[i]
    return -1


@njit(cache=True)
def augment(trees: Trees, arcs: Arcs, capacity: np.ndarray, terminal: np.ndarray, middle: int):
    """Push all that fits along the path through arc `middle`; how much. What is used up leaves orphans."""
    parent, heads = trees.parent, arcs.heads
    pushed = capacity[middle]
    i = heads[middle ^ 1]
    while parent[i] != TERMINAL:
        pushed = min(pushed, capacity[parent[i] ^ 1])
        i = heads[parent[i]]
    pushed = min(pushed, terminal[i])
    j = heads[middle]
    while parent[j] != TERMINAL:
        pushed = min(pushed, capacity[parent[j]])
        j = heads[parent[j]]
    pushed = min(pushed, -terminal[j])

    capacity[middle] -= pushed
    capacity[middle ^ 1] += pushed
    _drain(trees, arcs, capacity, heads[middle ^ 1], 1, pushed)
    _drain(trees, arcs, capacity, heads[middle], 0, pushed)
    terminal[i] -= pushed
    if terminal[i] == 0:
        _orphan(trees, i)
    terminal[j] += pushed
    if terminal[j] == 0:
        _orphan(trees, j)
    return pushed


@njit(cache=True)
def _drain(trees: Trees, arcs: Arcs, capacity: np.ndarray, i, way: int, pushed) -> None:
    """From node i to its terminal, take `pushed` from the arcs that flow takes: the parent's arc (way 0), its other."""
    while trees.parent[i] != TERMINAL:
        a = trees.parent[i] ^ way
        capacity[a] -= pushed
        capacity[a ^ 1] += pushed
        next_one = arcs.heads[trees.parent[i]]
        if capacity[a] == 0:
            _orphan(trees, i)
        i = next_one


@njit(cache=True)
def _orphan(trees: Trees, i) -> None:
    trees.parent[i] = ORPHAN
    at = trees.state[ORPHANS_AT] + trees.state[ORPHANS_LEFT]
    trees.orphans[at if at < len(trees.orphans) else at - len(trees.orphans)] = i
    trees.state[ORPHANS_LEFT] += 1


@njit(cache=True)
def adopt(trees: Trees, arcs: Arcs, capacity: np.ndarray) -> None:
    """Give each orphan the parent nearest to its terminal; without one it leaves the tree, its children orphans."""
    state, orphans = trees.state, trees.orphans
    while state[ORPHANS_LEFT] > 0:
        i = orphans[state[ORPHANS_AT]]
        state[ORPHANS_AT] = (state[ORPHANS_AT] + 1) % len(orphans)
        state[ORPHANS_LEFT] -= 1
        way = 0 if trees.sink[i] else 1
        best, nearest = FREE, FAR
        for at in range(arcs.first[i], arcs.first[i + 1]):
            a = arcs.leaving[at]
            j = arcs.heads[a]
            if capacity[a ^ way] > 0 and trees.parent[j] != FREE and trees.sink[j] == trees.sink[i]:
                distance = _distance(trees, arcs, j)
                if distance < nearest:
                    best, nearest = a, distance
        if best != FREE:
            trees.parent[i], trees.distance[i] = best, nearest + 1
            trees.seen[i] = state[CLOCK]
        else:
            _leave(trees, arcs, capacity, i)


@njit(cache=True)
def _distance(trees: Trees, arcs: Arcs, start):
    """Arcs from a node to its terminal, FAR where the way ends at an orphan. Writes what it finds along the way."""
    parent, distance, seen, now = trees.parent, trees.distance, trees.seen, trees.state[CLOCK]
    steps, j = 0, start
    while True:
        if seen[j] == now:
            steps += distance[j]
            break
        if parent[j] == ORPHAN:
            return FAR
        steps += 1
        if parent[j] == TERMINAL:
            seen[j], distance[j] = now, 1
            break
        j = arcs.heads[parent[j]]
    j, left = start, steps
    while seen[j] != now:
        seen[j], distance[j] = now, left
        left -= 1
        j = arcs.heads[parent[j]]
    return steps


@njit(cache=True)
def _leave(trees: Trees, arcs: Arcs, capacity: np.ndarray, i) -> None:
    """Free node i: neighbours that could reach it may grow to it again, its children become orphans."""
    way = 0 if trees.sink[i] else 1
    for at in range(arcs.first[i], arcs.first[i + 1]):
        a = arcs.leaving[at]
        j = arcs.heads[a]
        if trees.parent[j] == FREE or trees.sink[j] != trees.sink[i]:
            continue
        if capacity[a ^ way] > 0:
            activate(trees, j)
        if trees.parent[j] >= 0 and trees.parent[j] == a ^ 1:
            _orphan(trees, j)
    trees.parent[i] = FREE
