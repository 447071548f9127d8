import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from labelling_problems import SEEDS, cut_capacity, random_edges, scipy_flow

from thingmap.mapper.labelling.arcs import Arcs
from thingmap.mapper.labelling.max_flow import minimum_cut
from thingmap.mapper.labelling.neighbours import neighbour_pairs


@settings(max_examples=150, deadline=None)
@given(
    seed=SEEDS, nodes=st.integers(1, 30), share=st.floats(0.0, 0.6), most=st.integers(1, 50), ends=st.integers(1, 80)
)
def test_flow_is_scipys_and_the_cut_carries_it(seed: int, nodes: int, share: float, most: int, ends: int) -> None:
    rng = np.random.default_rng(seed)
    arcs = Arcs.of(nodes, random_edges(rng, nodes, share))
    capacity = rng.integers(0, most + 1, len(arcs.heads))
    terminal = rng.integers(-ends, ends + 1, nodes)
    expected = scipy_flow(arcs, capacity, terminal)
    for kind in (np.int64, np.float64):
        cut = minimum_cut(arcs, capacity.astype(kind), terminal.astype(kind))
        assert cut.flow == expected
        assert cut_capacity(arcs, capacity, terminal, cut.sink_side) == expected


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS)
def test_a_cut_of_real_capacities_carries_its_flow(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arcs = Arcs.of(25, random_edges(rng, 25, 0.3))
    capacity, terminal = rng.exponential(1.0, len(arcs.heads)), rng.normal(0.0, 4.0, 25)
    cut = minimum_cut(arcs, capacity.copy(), terminal.copy())
    assert cut_capacity(arcs, capacity, terminal, cut.sink_side) == pytest.approx(cut.flow, rel=1e-12, abs=1e-12)


def test_what_is_left_is_what_did_not_flow() -> None:
    rng = np.random.default_rng(3)
    arcs = Arcs.of(40, random_edges(rng, 40, 0.2))
    capacity, terminal = rng.integers(0, 9, len(arcs.heads)), rng.integers(-30, 30, 40)
    left, ends = capacity.copy(), terminal.copy()
    cut = minimum_cut(arcs, left, ends)
    assert (left >= 0).all() and (ends * terminal >= 0).all()
    assert (left.reshape(-1, 2).sum(axis=1) == capacity.reshape(-1, 2).sum(axis=1)).all()
    sent = (capacity - left).reshape(-1, 2)[:, 0]  # along each edge, from its lower node to its higher
    gained = np.bincount(arcs.heads[::2], sent, 40) - np.bincount(arcs.heads[1::2], sent, 40)
    assert (gained == ends - terminal).all()
    assert np.maximum(terminal - ends, 0).sum() == cut.flow


def test_a_chain_is_cut_at_its_weakest_arc() -> None:
    arcs = Arcs.of(4, np.array([[0, 1], [1, 2], [2, 3]], np.int32))
    capacity = np.array([5.0, 0.0, 2.0, 9.0, 4.0, 0.0])
    cut = minimum_cut(arcs, capacity, np.array([7.0, 0.0, 0.0, -6.0]))
    assert cut.flow == 2.0
    assert cut.sink_side.tolist() == [False, False, True, True]


def test_of_equal_cuts_the_sink_gets_the_fewest_nodes() -> None:
    arcs = Arcs.of(3, np.array([[0, 1], [1, 2]], np.int32))
    cut = minimum_cut(arcs, np.array([1, 1, 1, 1]), np.array([5, 0, -5]))
    assert cut.sink_side.tolist() == [False, False, True]


def test_a_grid_of_thousands_of_voxels() -> None:
    rng = np.random.default_rng(0)
    arcs = Arcs.of(4096, neighbour_pairs(np.indices((16, 16, 16)).reshape(3, -1).T))
    capacity = rng.integers(0, 20, len(arcs.heads))
    terminal = rng.integers(-150, 150, 4096)
    cut = minimum_cut(arcs, capacity.copy(), terminal.copy())
    assert cut.flow == scipy_flow(arcs, capacity, terminal)
    again = minimum_cut(arcs, capacity.copy(), terminal.copy())
    assert (again.sink_side == cut.sink_side).all()


def test_nodes_without_edges_stay_with_their_terminal() -> None:
    cut = minimum_cut(Arcs.of(3, np.empty((0, 2), np.int32)), np.empty(0), np.array([1.0, -1.0, 0.0]))
    assert cut.flow == 0.0
    assert cut.sink_side.tolist() == [False, True, False]


def test_capacities_that_do_not_fit_are_refused() -> None:
    arcs = Arcs.of(2, np.array([[0, 1]], np.int32))
    with pytest.raises(ValueError, match="all float64 or all int64"):
        minimum_cut(arcs, np.zeros(2, np.float32), np.zeros(2))
    with pytest.raises(ValueError, match="do not fit"):
        minimum_cut(arcs, np.zeros(3), np.zeros(2))
