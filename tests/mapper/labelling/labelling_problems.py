"""Small random energies and graphs, and the answers by trying everything or by scipy."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import strategies as st
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_flow

from thingmap.mapper.labelling.arcs import Arcs
from thingmap.mapper.labelling.energy import PottsEnergy

SEEDS = st.integers(0, 2**32 - 1)


def random_edges(rng: np.random.Generator, nodes: int, share: float) -> np.ndarray:
    """(E, 2) int32, each pair with probability `share`."""
    low, high = np.triu_indices(nodes, 1)
    chosen = rng.random(len(low)) < share
    return np.stack([low, high], axis=1)[chosen].astype(np.int32)


def random_energy(seed: int, nodes: int, labels: int, strength: float = 2.0, share: float = 0.5) -> PottsEnergy:
    """Costs of both signs, weights from 0 to `strength`."""
    rng = np.random.default_rng(seed)
    edges = random_edges(rng, nodes, share)
    weights = rng.uniform(0.0, strength, len(edges)).astype(np.float32)
    return PottsEnergy(rng.normal(0.0, 2.0, (nodes, labels)).astype(np.float32), edges, weights)


def random_tree(seed: int, nodes: int, labels: int) -> PottsEnergy:
    """Each node but the first joined to one before it."""
    rng = np.random.default_rng(seed)
    edges = np.array([(rng.integers(0, i), i) for i in range(1, nodes)], np.int32)
    weights = rng.uniform(0.0, 3.0, len(edges)).astype(np.float32)
    return PottsEnergy(rng.normal(0.0, 2.0, (nodes, labels)).astype(np.float32), edges, weights)


def by_hand(energy: PottsEnergy, labels: np.ndarray) -> float:
    """E(y), written out with numpy."""
    unary = energy.unary.astype(np.float64)[np.arange(len(labels)), labels].sum()
    differ = labels[energy.edges[:, 0]] != labels[energy.edges[:, 1]]
    return float(unary + energy.weights.astype(np.float64)[differ].sum())


def least(energy: PottsEnergy) -> tuple[np.ndarray, float]:
    """The labels of least energy and that energy, of all L^N."""
    every = (np.array(y) for y in itertools.product(range(energy.labels), repeat=energy.nodes))
    best = min(every, key=lambda y: by_hand(energy, y))
    return best, by_hand(energy, best)


def scipy_flow(arcs: Arcs, capacity: np.ndarray, terminal: np.ndarray) -> int:
    """The maximum flow of an integer graph by scipy."""
    n, tails = len(terminal), arcs.heads[np.arange(len(arcs.heads)) ^ 1]
    from_source, to_sink = np.flatnonzero(terminal > 0), np.flatnonzero(terminal < 0)
    rows = np.concatenate([tails, np.full(len(from_source), n), to_sink])
    columns = np.concatenate([arcs.heads, from_source, np.full(len(to_sink), n + 1)])
    values = np.concatenate([capacity, terminal[from_source], -terminal[to_sink]]).astype(np.int32)
    return int(maximum_flow(csr_matrix((values, (rows, columns)), shape=(n + 2, n + 2)), n, n + 1).flow_value)


def cut_capacity(arcs: Arcs, capacity: np.ndarray, terminal: np.ndarray, sink_side: np.ndarray) -> float:
    """What the arcs from the source's side to the sink's can carry."""
    tails = arcs.heads[np.arange(len(arcs.heads)) ^ 1]
    between = capacity[~sink_side[tails] & sink_side[arcs.heads]].sum()
    return between + terminal[sink_side & (terminal > 0)].sum() - terminal[~sink_side & (terminal < 0)].sum()
