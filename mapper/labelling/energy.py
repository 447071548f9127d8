"""The energy that labels of voxels minimise, equation (1) of Lai et al."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from .arcs import Arcs


@dataclass(frozen=True, slots=True, eq=False)
class PottsEnergy:
    """E(y) = sum_v psi_v(y_v) + sum_{i,j} w_ij 1[y_i != y_j] over N nodes with L labels and E edges.

    Attributes:
        unary: (N, L) float32, psi_v: what each label costs each node, nats.
        edges: (E, 2) int32 nodes of each edge, the lower first.
        weights: (E,) float32, w_ij >= 0: what it costs that the two differ, nats.

    Raises:
        ValueError: shapes or types do not fit, a cost is not finite or a weight negative, an edge is no pair of nodes.
    """

    unary: np.ndarray
    edges: np.ndarray
    weights: np.ndarray

    def __post_init__(self) -> None:
        if self.unary.ndim != 2 or self.unary.shape[1] < 1 or self.unary.dtype != np.float32:
            raise ValueError(f"unary must be (N, L) float32, but is {self.unary.shape} {self.unary.dtype}")
        if self.edges.ndim != 2 or self.edges.shape[1] != 2 or self.edges.dtype != np.int32:
            raise ValueError(f"edges must be (E, 2) int32, but are {self.edges.shape} {self.edges.dtype}")
        if self.weights.shape != (len(self.edges),) or self.weights.dtype != np.float32:
            raise ValueError(
                f"weights must be ({len(self.edges)},) float32, but are {self.weights.shape} {self.weights.dtype}"
            )
        if not np.isfinite(self.unary).all():
            raise ValueError("unary costs must be finite")
        if not (np.isfinite(self.weights) & (self.weights >= 0)).all():
            raise ValueError("weights must be finite and not negative")
        low, high = self.edges[:, 0], self.edges[:, 1]
        if not ((low >= 0) & (low < high) & (high < len(self.unary))).all():
            raise ValueError(f"edges must join two of {len(self.unary)} nodes, the lower first")

    @property
    def nodes(self) -> int:
        """N."""
        return self.unary.shape[0]

    @property
    def labels(self) -> int:
        """L."""
        return self.unary.shape[1]

    def of(self, labels: np.ndarray) -> float:
        """E(y) in nats of (N,) labels in [0, L)."""
        return float(_energy(self.unary, self.edges, self.weights, labels))

    def cheapest(self) -> np.ndarray:
        """(N,) int32 labels by the data term alone (DetOnly of Lai et al.), the first of equals."""
        return self.unary.argmin(axis=1).astype(np.int32)

    def arcs(self) -> Arcs:
        """The edges as arcs in both directions."""
        return Arcs.of(self.nodes, self.edges)


@njit(cache=True)
def _energy(unary: np.ndarray, edges: np.ndarray, weights: np.ndarray, labels: np.ndarray) -> float:
    total = 0.0
    for i in range(len(unary)):
        total += unary[i, labels[i]]
    for e in range(len(edges)):
        if labels[edges[e, 0]] != labels[edges[e, 1]]:
            total += weights[e]
    return total
