"""Multi-class graph cuts: alpha-expansion of Boykov, Veksler and Zabih (PAMI 23(11), 2001)."""

from __future__ import annotations

import numpy as np
from numba import njit

from .energy import PottsEnergy
from .labels import Labelling
from .max_flow import minimum_cut
from .mean_field import mean_field


def expand(energy: PottsEnergy, start: np.ndarray | None = None, max_sweeps: int = 8) -> Labelling:
    """Let each label in turn take over whichever nodes make the energy least, until none can lower it.

    Each such move is the best of exponentially many, found by one minimum cut. Where it settles, the energy is at
    most the data term of the best labels plus twice their pairwise term, and with two labels it is the least.

    Args:
        energy: to minimise.
        start: (N,) labels in [0, L) to begin with; `good_start` if None.
        max_sweeps: over all labels, at most.

    Raises:
        ValueError: `start` is no labelling of these nodes.
    """
    if start is not None and (start.shape != (energy.nodes,) or not ((start >= 0) & (start < energy.labels)).all()):
        raise ValueError(f"start must be ({energy.nodes},) labels from 0 to {energy.labels - 1}")
    labels = good_start(energy) if start is None else start.astype(np.int32)
    now, arcs = energy.of(labels), energy.arcs()
    capacity, terminal = np.empty(len(arcs.heads)), np.empty(energy.nodes)
    futile = 0  # moves in a row that changed nothing: after one of each label nothing more will
    for move in range(max_sweeps * energy.labels):
        label = move % energy.labels
        move_costs(energy.unary, energy.edges, energy.weights, labels, label, capacity, terminal)
        moved = np.where(minimum_cut(arcs, capacity, terminal).sink_side, np.int32(label), labels)
        after = energy.of(moved)
        if after < now:  # by rounding, a cut may look cheaper than it is
            labels, now, futile = moved, after, 0
        else:
            futile += 1
        if futile == energy.labels:
            return Labelling(labels, now, move // energy.labels + 1, True)
    return Labelling(labels, now, max_sweeps, False)


def good_start(energy: PottsEnergy) -> np.ndarray:
    """(N,) int32, the labels of least energy among: the same for all nodes, the cheapest of each node, mean field's.

    Cuts take the longer the more has to move: where weights are strong, several times as long from the cheapest labels.
    """
    same = energy.unary.sum(axis=0, dtype=np.float64)
    best = np.full(energy.nodes, same.argmin(), np.int32)
    for labels in (energy.cheapest(), mean_field(energy).labelling.labels):
        if energy.of(labels) < energy.of(best):
            best = labels
    return best


@njit(cache=True)
def move_costs(unary, edges, weights, labels, label, capacity, terminal) -> None:
    """Write the graph whose cuts cost what expansions of `label` do: nodes on the sink's side take it.

    Of a pair neither of which has it, with different labels, all but both taking it cost w: half of w each for keeping,
    and half across, in both directions. With the same label, w across. Those that have it already are left out.
    """
    for i in range(len(labels)):
        terminal[i] = 0.0 if labels[i] == label else float(unary[i, label]) - float(unary[i, labels[i]])
    for e in range(len(edges)):
        i, j, w = edges[e, 0], edges[e, 1], float(weights[e])
        across = 0.0
        if labels[i] == label:
            if labels[j] != label:
                terminal[j] -= w
        elif labels[j] == label:
            terminal[i] -= w
        elif labels[i] == labels[j]:
            across = w
        else:
            across = 0.5 * w
            terminal[i] -= across
            terminal[j] -= across
        capacity[2 * e] = capacity[2 * e + 1] = across
