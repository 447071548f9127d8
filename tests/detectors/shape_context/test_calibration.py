"""From scores to probabilities."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.detectors.shape_context.calibration import Calibration, fit_calibration


def drawn(count: int, true: Calibration, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Samples whose labels follow a calibration; a third of the scores are absent."""
    rng = np.random.default_rng(seed)
    scores = rng.normal(0.0, 2.0, (count, len(true.slope)))
    scores[rng.random(scores.shape) < 1 / 3] = np.nan
    p = true.distribution(scores)
    return scores, (rng.random(count)[:, None] > p.cumsum(axis=1)[:, :-1]).sum(axis=1)


def test_the_parameters_that_samples_were_drawn_with_are_found():
    true = Calibration(np.array([1.5, 0.7]), np.array([0.5, -1.0]), np.array([-2.0, -1.5]))
    found = fit_calibration(*drawn(20000, true, 0))
    for name in ("slope", "offset", "absent"):
        np.testing.assert_allclose(getattr(found, name), getattr(true, name), atol=0.12)


def test_claimed_shares_are_observed_ones():
    """At the maximum the mean probability of each class is its share, whatever the samples are."""
    rng = np.random.default_rng(1)
    scores, label = rng.normal(size=(3000, 3)), rng.integers(0, 4, 3000)
    p = fit_calibration(scores, label).distribution(scores)
    np.testing.assert_allclose(p.mean(axis=0), np.bincount(label) / 3000, atol=2e-3)


def test_a_score_that_says_less_than_nothing_is_not_turned_round():
    scores = np.array([[3.0], [2.0], [-2.0], [-3.0]] * 20)
    label = np.array([1, 1, 0, 0] * 20)
    assert fit_calibration(scores, label).slope == pytest.approx([0.0])


def test_weights_are_numbers_of_samples():
    scores, label = drawn(60, Calibration(np.ones(2), np.zeros(2), np.full(2, -1.0)), 2)
    twice = fit_calibration(np.repeat(scores, 2, axis=0), np.repeat(label, 2))
    weighed = fit_calibration(scores, label, np.full(60, 2.0))
    np.testing.assert_allclose(twice.distribution(scores), weighed.distribution(scores), atol=1e-4)


@given(st.lists(st.one_of(st.floats(-1e6, 1e6), st.just(float("nan"))), min_size=3, max_size=3))
def test_a_distribution_is_one_for_any_scores(row):
    p = Calibration(np.ones(3), np.zeros(3), np.zeros(3)).distribution(np.array([row]))
    assert p.shape == (1, 4) and np.isfinite(p).all() and p.sum() == pytest.approx(1.0)


def test_a_higher_score_is_more_probable():
    p = Calibration(np.ones(2), np.zeros(2), np.full(2, -5.0)).distribution(np.array([[0.0, np.nan], [3.0, np.nan]]))
    assert p[1, 0] > p[0, 0] and p[1, 2] < p[0, 2] and p[:, 1].max() < 0.01


@pytest.mark.parametrize(
    ("scores", "label", "message"),
    [
        (np.zeros((2, 2)), np.array([0]), "as many labels"),
        (np.zeros((0, 2)), np.zeros(0, int), "at least one"),
        (np.zeros((1, 2)), np.array([3]), r"must be in 0\.\.2"),
    ],
)
def test_samples_that_do_not_fit(scores, label, message):
    with pytest.raises(ValueError, match=message):
        fit_calibration(scores, label)


def test_parameters_that_do_not_fit():
    with pytest.raises(ValueError, match="must not be negative"):
        Calibration(np.array([-1.0]), np.zeros(1), np.zeros(1))
    with pytest.raises(ValueError, match="one for each class"):
        Calibration(np.ones(2), np.zeros(1), np.zeros(2))
