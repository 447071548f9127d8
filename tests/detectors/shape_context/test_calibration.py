"""From scores to probabilities."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.detectors.shape_context.calibration import (
    FEATURES,
    LIMIT,
    Calibration,
    calibration_features,
    fit_calibration,
)
from thingmap.detectors.shape_context.scoring import ImageScores

WIDE = len(FEATURES)


def drawn(count: int, true: Calibration, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Samples whose labels follow a calibration."""
    rng = np.random.default_rng(seed)
    features = rng.normal(0.0, 1.0, (count, len(true.offset), WIDE))
    p = true.distribution(features)
    return features, (rng.random(count)[:, None] > p.cumsum(axis=1)[:, :-1]).sum(axis=1)


def even(classes: int) -> Calibration:
    return Calibration(np.ones((classes, WIDE)), np.zeros(classes))


def test_the_parameters_that_samples_were_drawn_with_are_found():
    weights = np.array([[0.5, 1.5, 0.7, 1.0, 0.2], [-0.5, 0.3, 1.0, 0.6, 0.0]])
    true = Calibration(weights, np.array([0.5, -1.0]))
    found = fit_calibration(*drawn(20000, true, 0))
    np.testing.assert_allclose(found.weights, true.weights, atol=0.12)
    np.testing.assert_allclose(found.offset, true.offset, atol=0.12)


def test_claimed_shares_are_observed_ones():
    """At the maximum the mean probability of each class is its share, whatever the samples are."""
    rng = np.random.default_rng(1)
    features, label = rng.normal(size=(3000, 3, WIDE)), rng.integers(0, 4, 3000)
    p = fit_calibration(features, label).distribution(features)
    np.testing.assert_allclose(p.mean(axis=0), np.bincount(label) / 3000, atol=2e-3)


def test_a_score_that_says_less_than_nothing_is_not_turned_round():
    features = np.zeros((80, 1, WIDE))
    features[:, 0, FEATURES.index("log strength")] = [3.0, 2.0, -2.0, -3.0] * 20
    found = fit_calibration(features, np.array([1, 1, 0, 0] * 20))
    assert found.weights[0, FEATURES.index("log strength")] == 0.0


def test_weights_are_numbers_of_samples():
    features, label = drawn(60, even(2), 2)
    twice = fit_calibration(np.repeat(features, 2, axis=0), np.repeat(label, 2))
    weighed = fit_calibration(features, label, np.full(60, 2.0))
    np.testing.assert_allclose(twice.distribution(features), weighed.distribution(features), atol=1e-3)


@given(st.lists(st.floats(-1e6, 1e6), min_size=3 * WIDE, max_size=3 * WIDE))
def test_a_distribution_is_one_for_any_features(row):
    p = even(3).distribution(np.array(row).reshape(1, 3, WIDE))
    assert p.shape == (1, 4) and np.isfinite(p).all() and p.sum() == pytest.approx(1.0)


def test_features_of_scores():
    nan = np.nan
    scores = ImageScores(
        normalised=np.array([[0.5, nan]]),
        strength=np.array([[1.2, 0.0]]),
        agreement=np.array([[0.4, 0.0]]),
        contour=np.array([[0.3, -0.2]]),
        boxes=np.zeros((1, 2, 4)),
        hypotheses=(),
        votes=(),
    )
    found = calibration_features(scores, np.array([0.5]))
    assert found[0].tolist() == pytest.approx(np.array([[1.0, np.log(1.2), 0.4, 0.3, 0.0], [0.0, 0.0, 0.0, -0.2, 0.0]]))
    sure = calibration_features(scores, np.array([1.0]))
    assert sure[0, :, FEATURES.index("objectness")].tolist() == [LIMIT, LIMIT]


@pytest.mark.parametrize(
    ("count", "label", "message"),
    [(2, [0], "as many labels"), (0, [], "at least one"), (1, [3], r"must be in 0\.\.2")],
)
def test_samples_that_do_not_fit(count, label, message):
    with pytest.raises(ValueError, match=message):
        fit_calibration(np.zeros((count, 2, WIDE)), np.array(label, dtype=int))


def test_parameters_that_do_not_fit():
    with pytest.raises(ValueError, match="weights must be"):
        Calibration(np.ones((1, 2)), np.zeros(1))
    with pytest.raises(ValueError, match="finite"):
        Calibration(np.ones((1, WIDE)), np.array([np.inf]))
