import numpy as np
import pytest
from hypothesis import given, settings
from labelling_problems import SEEDS, by_hand, random_energy

from thingmap.mapper.labelling.energy import PottsEnergy

EDGES, WEIGHTS = np.array([[0, 1], [1, 2]], np.int32), np.array([1.0, 2.0], np.float32)
UNARY = np.array([[0.0, 4.0], [3.0, 3.0], [1.0, 0.5]], np.float32)


def test_energy_of_a_chain_counted_by_hand() -> None:
    energy = PottsEnergy(UNARY, EDGES, WEIGHTS)
    assert energy.of(np.array([0, 0, 0])) == 4.0
    assert energy.of(np.array([0, 1, 1])) == 4.5
    assert energy.of(np.array([1, 0, 1])) == 10.5
    assert energy.cheapest().tolist() == [0, 0, 1]


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS)
def test_energy_is_what_numpy_says(seed: int) -> None:
    energy = random_energy(seed, 20, 4)
    labels = np.random.default_rng(seed).integers(0, 4, 20)
    assert energy.of(labels) == pytest.approx(by_hand(energy, labels), abs=1e-9)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"unary": UNARY.astype(np.float64)}, "float32"),
        ({"unary": np.full((3, 2), np.nan, np.float32)}, "finite"),
        ({"weights": -WEIGHTS}, "not negative"),
        ({"weights": WEIGHTS[:1]}, "weights must be"),
        ({"edges": EDGES[:, ::-1].copy()}, "the lower first"),
        ({"edges": EDGES + np.int32(1)}, "3 nodes"),
        ({"edges": EDGES.astype(np.int64)}, "int32"),
    ],
)
def test_what_is_no_energy_is_refused(change: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        PottsEnergy(**({"unary": UNARY, "edges": EDGES, "weights": WEIGHTS} | change))
