import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from labelling_problems import SEEDS, least, random_energy, random_tree

from thingmap.mapper.labelling.alpha_expansion import expand
from thingmap.mapper.labelling.dual_bound import DualBound, bound_energy
from thingmap.mapper.labelling.minimise import minimise
from thingmap.mapper.labelling.mrf_config import MrfConfig


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, nodes=st.integers(1, 6), labels=st.integers(1, 4), sweeps=st.integers(1, 20))
def test_no_labelling_is_below_the_bound(seed: int, nodes: int, labels: int, sweeps: int) -> None:
    energy = random_energy(seed, nodes, labels, 4.0, share=0.8)
    assert bound_energy(energy, sweeps).bound <= least(energy)[1] + 1e-6


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, nodes=st.integers(1, 7))
def test_on_trees_it_is_the_least_energy(seed: int, nodes: int) -> None:
    energy = random_tree(seed, nodes, 3) if nodes > 1 else random_energy(seed, 1, 3)
    assert bound_energy(energy, 100).bound == pytest.approx(least(energy)[1], abs=1e-4)


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_on_large_trees_it_meets_the_cuts(seed: int) -> None:
    tree = random_tree(seed, 300, 2)
    assert bound_energy(tree, 500).gap(expand(tree).energy) == pytest.approx(0.0, abs=1e-3)


def test_more_sweeps_never_lower_it() -> None:
    energy = random_energy(7, 60, 4, 1.0, share=0.1)
    bounds = [bound_energy(energy, sweeps).bound for sweeps in (1, 2, 4, 8, 16)]
    assert bounds == sorted(bounds)
    assert bounds[-1] > bounds[0]


def test_it_is_close_below_where_weights_are_modest() -> None:
    energy = random_energy(8, 200, 5, 0.5, share=0.03)
    assert -1e-12 <= bound_energy(energy, 50).gap(expand(energy).energy) < 0.01


def test_gap_of_nothing() -> None:
    assert DualBound(0.0, 1).gap(0.0) == 0.0
    assert DualBound(0.0, 1).gap(1.0) == np.inf
    assert DualBound(-4.0, 1).gap(-3.0) == 0.25


def test_the_configuration_chooses_means_and_bound() -> None:
    energy = random_energy(9, 300, 5, 2.0, share=0.02)
    by_cuts = minimise(energy, MrfConfig(bound_sweeps=20))
    quick = minimise(energy, MrfConfig(fast=True))
    assert by_cuts.labelling.energy <= quick.labelling.energy
    assert quick.gap is None
    assert by_cuts.gap is not None and -1e-12 <= by_cuts.gap < 0.2
