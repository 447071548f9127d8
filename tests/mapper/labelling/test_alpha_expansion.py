import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from labelling_problems import SEEDS, by_hand, least, random_energy

from thingmap.mapper.labelling.alpha_expansion import expand, good_start
from thingmap.mapper.labelling.energy import PottsEnergy
from thingmap.mapper.labelling.neighbours import neighbour_pairs

STRENGTHS = st.sampled_from([0.1, 1.0, 3.0, 30.0])


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, nodes=st.integers(1, 9), strength=STRENGTHS)
def test_two_labels_are_exact_from_any_start(seed: int, nodes: int, strength: float) -> None:
    energy = random_energy(seed, nodes, 2, strength)
    start = np.random.default_rng(seed).integers(0, 2, nodes)
    found = expand(energy, start)
    assert found.settled
    assert found.energy == pytest.approx(least(energy)[1], abs=1e-5)


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, nodes=st.integers(1, 6), strength=STRENGTHS)
def test_more_labels_are_within_the_known_bound(seed: int, nodes: int, strength: float) -> None:
    energy = random_energy(seed, nodes, 4, strength)
    best, lowest = least(energy)
    found = expand(energy)
    data = float(energy.unary[np.arange(nodes), best].sum())
    assert lowest - 1e-5 <= found.energy <= data + 2.0 * (lowest - data) + 1e-5  # Boykov, Veksler, Zabih, theorem 6.1
    assert found.energy == pytest.approx(by_hand(energy, found.labels), abs=1e-5)


def test_most_small_energies_are_solved_exactly() -> None:
    exact = 0
    for seed in range(40):
        energy = random_energy(seed, 6, 4, 2.0)
        exact += expand(energy).energy <= least(energy)[1] + 1e-5
    assert exact >= 36


@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, strength=STRENGTHS)
def test_energy_never_rises_from_sweep_to_sweep(seed: int, strength: float) -> None:
    energy = random_energy(seed, 60, 5, strength, share=0.1)
    start = np.random.default_rng(seed).integers(0, 5, 60)
    energies = [energy.of(start)] + [expand(energy, start, sweeps).energy for sweeps in range(1, 6)]
    assert all(later <= earlier for earlier, later in itertools.pairwise(energies))
    assert expand(energy, start, 50).settled


def test_where_it_settles_no_label_can_take_a_node_with_gain() -> None:
    energy = random_energy(5, 80, 4, 2.0, share=0.08)
    found = expand(energy)
    for node in range(80):
        for label in range(4):
            other = found.labels.copy()
            other[node] = label
            assert energy.of(other) >= found.energy - 1e-5


def test_without_weights_each_node_takes_its_cheapest() -> None:
    energy = random_energy(1, 50, 6, 0.0)
    assert (expand(energy).labels == energy.cheapest()).all()


def test_huge_weights_make_one_label_of_what_hangs_together() -> None:
    energy = random_energy(2, 12, 3)
    chained = PottsEnergy(
        energy.unary, np.array([[i, i + 1] for i in range(11)], np.int32), np.full(11, 1e4, np.float32)
    )
    assert set(expand(chained).labels) == {int(energy.unary.sum(axis=0).argmin())}


def test_a_good_start_is_none_of_the_worse_ones() -> None:
    for seed in range(10):
        energy = random_energy(seed, 40, 4, 1.0, share=0.1)
        assert energy.of(good_start(energy)) <= energy.of(energy.cheapest())
        assert energy.of(good_start(energy)) <= min(energy.of(np.full(40, k)) for k in range(4))


def test_a_block_in_a_noisy_grid_is_found_again() -> None:
    rng = np.random.default_rng(0)
    voxels = np.indices((12, 12, 12)).reshape(3, -1).T
    truth = ((voxels >= 3) & (voxels < 9)).all(axis=1).astype(np.int32)
    unary = rng.normal(0.0, 1.2, (len(voxels), 3)).astype(np.float32)
    unary[np.arange(len(voxels)), truth] -= 1.5
    edges = neighbour_pairs(voxels)
    energy = PottsEnergy(unary, edges, np.full(len(edges), 0.1, np.float32))
    wrong = (energy.cheapest() != truth).mean()
    found = expand(energy)
    assert wrong > 0.2
    assert (found.labels != truth).mean() < wrong / 3
    assert (expand(energy).labels == found.labels).all()
    assert found.energy < energy.of(truth)


@pytest.mark.parametrize("start", [np.zeros(4, int), np.full(5, 3), np.full(5, -1)])
def test_a_start_of_other_labels_is_refused(start: np.ndarray) -> None:
    with pytest.raises(ValueError, match="labels from 0 to 2"):
        expand(random_energy(0, 5, 3), start)


def test_nothing_to_label_is_no_trouble() -> None:
    energy = PottsEnergy(np.empty((0, 3), np.float32), np.empty((0, 2), np.int32), np.empty(0, np.float32))
    found = expand(energy)
    assert found.labels.shape == (0,) and found.energy == 0.0 and found.settled
