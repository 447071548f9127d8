import numpy as np
import pytest

from thingmap.mapper.evaluation.uncertainty.calibration import (
    LOG_FLOOR,
    bin_claims,
    calibrate_classes,
    calibrate_outcomes,
    calibration_metrics,
    reliability_plot,
    reliability_table,
)


def test_outcomes_by_hand():
    # Bins of 0.1: {0.95, 0.93} both true, {0.62, 0.68} one true, {0.05} false.
    probability = np.array([0.95, 0.62, 0.93, 0.05, 0.68])
    outcome = np.array([True, False, True, False, True])
    result = calibrate_outcomes(probability, outcome, 10)
    gaps = [0.06, 0.15, 0.05]
    assert result.reliability.expected_error == pytest.approx((2 * gaps[0] + 2 * gaps[1] + gaps[2]) / 5)
    assert result.reliability.maximum_error == pytest.approx(0.15)
    assert result.brier == pytest.approx((0.05**2 + 0.62**2 + 0.07**2 + 0.05**2 + 0.32**2) / 5)
    assert result.log_loss == pytest.approx(-np.log([0.95, 0.38, 0.93, 0.95, 0.68]).mean())
    assert result.count == 5


def test_classes_by_hand():
    posterior = np.array([[0.7, 0.2, 0.1], [0.1, 0.3, 0.6], [0.25, 0.75, 0.0]])
    result = calibrate_classes(posterior, np.array([0, 1, 1]), 4)
    # Tops 0.7 right and 0.6 wrong in [0.5, 0.75); 0.75 right in [0.75, 1].
    assert result.reliability.expected_error == pytest.approx((2 * 0.15 + 0.25) / 3)
    assert result.reliability.maximum_error == pytest.approx(0.25)
    brier = [0.3**2 + 0.2**2 + 0.1**2, 0.1**2 + 0.7**2 + 0.6**2, 2 * 0.25**2]
    assert result.brier == pytest.approx(np.mean(brier))
    assert result.log_loss == pytest.approx(-np.log([0.7, 0.3, 0.75]).mean())


def test_bins_begin_with_their_lower_edge_and_the_last_holds_one():
    edges = np.arange(11) / 10.0
    np.testing.assert_array_equal(bin_claims(edges, np.ones(11, dtype=bool), 10).count, [1] * 9 + [2])


def test_probability_one_that_is_wrong_costs_the_floor():
    result = calibrate_outcomes(np.array([1.0]), np.array([False]), 10)
    assert result.log_loss == pytest.approx(-np.log(LOG_FLOOR)) and result.brier == 1.0
    result = calibrate_classes(np.array([[1.0, 0.0]]), np.array([1]), 10)
    assert result.log_loss == pytest.approx(-np.log(LOG_FLOOR)) and result.brier == 2.0


def test_draws_from_known_probabilities_are_calibrated_and_sharpened_ones_are_not():
    rng = np.random.default_rng(0)
    posterior = rng.dirichlet([1.0, 0.6, 0.4, 1.5], 40_000)
    drawn = np.array((posterior.cumsum(axis=1) > rng.random((len(posterior), 1))).argmax(axis=1))
    honest = calibrate_classes(posterior, drawn, 10)
    assert honest.reliability.expected_error < 0.01
    assert honest.brier == pytest.approx(np.mean(1.0 - np.sum(posterior**2, axis=1)), abs=0.01)
    entropy = -np.sum(posterior * np.log(np.maximum(posterior, 1e-300)), axis=1)
    assert honest.log_loss == pytest.approx(entropy.mean(), abs=0.01)
    sharp = posterior**3 / np.sum(posterior**3, axis=1, keepdims=True)
    boastful = calibrate_classes(sharp, drawn, 10)
    assert boastful.reliability.expected_error > 0.1
    assert boastful.brier > honest.brier and boastful.log_loss > honest.log_loss


def test_existence_draws_are_calibrated():
    rng = np.random.default_rng(1)
    probability = rng.beta(0.5, 0.5, 40_000)
    result = calibrate_outcomes(probability, rng.random(len(probability)) < probability, 10)
    assert result.reliability.expected_error < 0.01 and result.reliability.maximum_error < 0.03


def test_no_claims_no_numbers():
    for result in (
        calibrate_outcomes(np.empty(0), np.empty(0, dtype=bool), 10),
        calibrate_classes(np.empty((0, 3)), np.empty(0, dtype=np.int64), 10),
        calibrate_classes(np.empty((0, 0)), np.empty(0, dtype=np.int64), 10),
    ):
        values = {metric.name: metric.value for metric in calibration_metrics("class", result)}
        assert values == {
            "class ECE": None,
            "class MCE": None,
            "class Brier score": None,
            "class log loss": None,
            "class samples": 0,
        }


def test_the_diagram_holds_the_bins_that_are_not_empty():
    reliability = bin_claims(np.array([0.95, 0.85, 0.97]), np.array([True, False, True]), 10)
    plot = reliability_plot("classes", reliability)
    assert plot.series[0].x == (0.0, 1.0) and plot.equal
    assert plot.series[1].x == pytest.approx((0.85, 0.96)) and plot.series[1].y == (0.0, 1.0)
    rows = reliability_table("classes", reliability).rows
    assert [row[:2] for row in rows] == [("0.8 to 0.9", 1), ("0.9 to 1", 2)]
