import numpy as np
import pytest
from labelling_problems import by_hand, least, random_energy

from thingmap.mapper.labelling.alpha_expansion import expand
from thingmap.mapper.labelling.energy import PottsEnergy
from thingmap.mapper.labelling.mean_field import mean_field


def test_without_weights_it_is_the_softmax_of_the_data_term() -> None:
    energy = random_energy(0, 30, 5, 0.0)
    likelihoods = np.exp(-energy.unary)
    found = mean_field(energy)
    assert found.probabilities == pytest.approx(likelihoods / likelihoods.sum(axis=1, keepdims=True), rel=1e-4)
    assert found.labelling.settled
    assert (found.labelling.labels == energy.cheapest()).all()


def test_where_it_settles_each_node_agrees_with_its_neighbours() -> None:
    energy = random_energy(1, 40, 4, 1.0, share=0.1)
    found = mean_field(energy, 200)
    assert found.labelling.settled
    q = found.probabilities.astype(np.float64)
    cost = energy.unary.astype(np.float64)
    for (i, j), w in zip(energy.edges, energy.weights, strict=True):
        cost[i] += w * (1.0 - q[j])
        cost[j] += w * (1.0 - q[i])
    expected = np.exp(-cost)
    assert q == pytest.approx(expected / expected.sum(axis=1, keepdims=True), abs=5e-3)


def divergence(energy: PottsEnergy, q: np.ndarray) -> float:
    """Of q from exp(-E), up to a constant."""
    apart = 1.0 - (q[energy.edges[:, 0]] * q[energy.edges[:, 1]]).sum(axis=1)
    return float((q * energy.unary).sum() + (energy.weights * apart).sum() + (q * np.log(q + 1e-30)).sum())


def test_sweeps_lower_the_divergence() -> None:
    energy = random_energy(2, 50, 4, 0.5, share=0.1)
    few, many = (mean_field(energy, n).probabilities.astype(np.float64) for n in (2, 30))
    assert divergence(energy, many) < divergence(energy, few)
    moved = 0.95 * many + 0.05 * few  # a point beside where it settled
    assert divergence(energy, many) <= divergence(energy, moved) + 1e-4


def test_energies_are_between_the_least_and_that_of_the_cheapest_labels() -> None:
    for seed in range(20):
        energy = random_energy(seed, 7, 3, 2.0)
        found = mean_field(energy, 40).labelling
        assert found.energy >= least(energy)[1] - 1e-5
        assert found.energy == pytest.approx(by_hand(energy, found.labels), abs=1e-5)
    large = random_energy(0, 400, 5, 1.0, share=0.02)
    assert expand(large).energy <= mean_field(large).labelling.energy < large.of(large.cheapest())


def test_strong_weights_do_not_overflow_and_rows_sum_to_one() -> None:
    found = mean_field(random_energy(3, 30, 4, 1e5))
    assert np.isfinite(found.probabilities).all()
    assert found.probabilities.sum(axis=1) == pytest.approx(np.ones(30), rel=1e-5)


def test_it_is_the_same_every_time() -> None:
    energy = random_energy(4, 100, 6, 1.0, share=0.05)
    assert (mean_field(energy).probabilities == mean_field(energy).probabilities).all()
