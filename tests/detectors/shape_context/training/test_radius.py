import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.detectors.shape_context.training.radius import best_radius, separations

score = st.one_of(st.just(np.nan), st.integers(-3, 3).map(float))


def column(values) -> np.ndarray:
    return np.array(values, dtype=np.float64)[:, None]


def test_by_hand():
    others = column([0.0, 1.0, np.nan])
    assert separations(column([2.0, 3.0]), others).tolist() == [1.0]
    assert separations(column([0.5]), others).tolist() == [pytest.approx(2 / 3)]
    assert separations(column([np.nan]), others).tolist() == [pytest.approx(0.5 / 3)]


@given(st.lists(score, min_size=1, max_size=6), st.lists(score, min_size=1, max_size=6))
def test_it_is_the_share_of_pairs_in_the_right_order(own, others):
    filled = [[-np.inf if np.isnan(x) else x for x in values] for values in (own, others)]
    pairs = [1.0 if a > b else 0.5 if a == b else 0.0 for a in filled[0] for b in filled[1]]
    assert separations(column(own), column(others))[0] == pytest.approx(np.mean(pairs))


def test_the_best_radius_and_of_equally_good_ones_the_usual():
    radii = (0.03, 0.09, 0.2)
    assert best_radius(radii, np.array([0.7, 0.8, 0.9])) == 0.2
    assert best_radius(radii, np.array([1.0, 1.0, 1.0])) == 0.09
    assert best_radius(radii, np.array([0.9, 0.7, 0.9])) == 0.2  # a factor of 2, not of 3
