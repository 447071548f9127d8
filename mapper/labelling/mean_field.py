"""Mean field: the quick way to a low energy, and to probabilities of labels.

The distribution exp(-E(y)) is approximated by independent ones of the nodes, q_i(k) proportional to
exp(-psi_i(k) - sum_j w_ij (1 - q_j(k))), one node after the other: each step lowers the divergence between the two.
With strong weights the end depends on the beginning, so the energy counts little at first, and more and more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from .arcs import Arcs
from .energy import PottsEnergy
from .labels import Labelling

HEAT = 64.0
"""By which the energy is divided in the first sweep. In the first half of the sweeps it falls to 1."""
STILL = 1e-3
"""Largest change of a probability in a sweep with which it has settled."""


@dataclass(frozen=True, slots=True, eq=False)
class MeanField:
    """Independent distributions of the nodes.

    Attributes:
        probabilities: (N, L) float32, rows sum to 1.
        labelling: the likeliest label of each node.
    """

    probabilities: np.ndarray
    labelling: Labelling


def mean_field(energy: PottsEnergy, max_sweeps: int = 15) -> MeanField:
    """Up to `max_sweeps` (at least 1) over all nodes, there and back in turn, fewer where nothing changes any more."""
    probabilities = np.full(energy.unary.shape, 1.0 / energy.labels, np.float32)
    arcs, cooling = energy.arcs(), max(1, max_sweeps // 2)
    change, sweep = 0.0, 0
    for sweep in range(1, max_sweeps + 1):
        heat = HEAT ** max(0.0, 1.0 - sweep / cooling)
        change = _sweep(energy.unary, energy.weights, arcs, probabilities, np.float32(1.0 / heat), sweep % 2 == 0)
        if sweep >= cooling and change < STILL:
            break
    labels = probabilities.argmax(axis=1).astype(np.int32)
    return MeanField(probabilities, Labelling(labels, energy.of(labels), sweep, bool(change < STILL)))


@njit(cache=True)
def _sweep(unary, weights, arcs: Arcs, q, scale, backwards):
    """Renew every row of `q`, with the energy multiplied by `scale`; the largest change."""
    nodes, labels = unary.shape
    cost = np.empty(labels, np.float32)
    largest = np.float32(0.0)
    for at in range(nodes):
        i = nodes - 1 - at if backwards else at
        for k in range(labels):
            cost[k] = unary[i, k]
        for place in range(arcs.first[i], arcs.first[i + 1]):
            a = arcs.leaving[place]
            j, w = arcs.heads[a], weights[a >> 1]
            for k in range(labels):
                cost[k] -= w * q[j, k]
        least = cost.min()
        total = np.float32(0.0)
        for k in range(labels):
            cost[k] = np.exp((least - cost[k]) * scale)
            total += cost[k]
        for k in range(labels):
            new = cost[k] / total
            largest = max(largest, abs(new - q[i, k]))
            q[i, k] = new
    return largest
