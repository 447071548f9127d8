import numpy as np
import pytest
from scipy.stats import chi2

from thingmap.mapper.evaluation.uncertainty.consistency import (
    chi_square_quantile,
    consistency_metrics,
    consistency_plot,
    measure_consistency,
)


def draws(count, dof, seed=0):
    """Errors drawn from random covariances, with the covariances."""
    rng = np.random.default_rng(seed)
    factors = rng.normal(size=(count, dof, dof)) + 2.0 * np.eye(dof)
    factors *= 10.0 ** rng.uniform(-3, 0, (dof, 1))  # radians beside metres
    return np.einsum("nij,nj->ni", factors, rng.normal(size=(count, dof))), factors @ factors.transpose(0, 2, 1)


def test_by_hand():
    covariances = np.stack([np.diag([4.0, 1.0]), np.array([[2.0, 1.0], [1.0, 2.0]])])
    result = measure_consistency(np.array([[2.0, 1.0], [1.0, 1.0]]), covariances)
    np.testing.assert_allclose(result.nees, [2.0, 2.0 / 3.0])
    assert result.mean_per_dof == pytest.approx(2.0 / 3.0)


def test_quantiles_are_those_of_scipy_stats():
    probability = np.array([0.001, 0.025, 0.5, 0.975, 0.999])
    for dof in (1, 3, 6, 6000):
        np.testing.assert_allclose(chi_square_quantile(probability, dof), chi2.ppf(probability, dof))


@pytest.mark.parametrize("dof", [3, 6])
def test_draws_from_the_stated_covariance_are_honest(dof):
    result = measure_consistency(*draws(500, dof))
    low, high = result.band
    assert low <= result.mean_per_dof <= high and result.verdict == "honest"
    assert (low, high) == pytest.approx(chi2.ppf([0.025, 0.975], 500 * dof) / (500 * dof))
    assert result.inside == pytest.approx(0.95, abs=0.03)


def test_the_band_holds_the_mean_in_95_of_100_runs():
    runs = [measure_consistency(*draws(40, 3, seed)) for seed in range(300)]
    held = [run.band[0] <= run.mean_per_dof <= run.band[1] for run in runs]
    assert np.mean(held) == pytest.approx(0.95, abs=0.04)


@pytest.mark.parametrize(("scale", "verdict"), [(2.0, "too sure"), (0.5, "too careful")])
def test_other_errors_are_outside_by_their_square(scale, verdict):
    errors, covariances = draws(200, 3)
    result = measure_consistency(scale * errors, covariances)
    assert result.mean_per_dof == pytest.approx(scale**2 * measure_consistency(errors, covariances).mean_per_dof)
    assert result.verdict == verdict


def test_units_do_not_matter():
    errors, covariances = draws(20, 6)
    scale = np.array([1e-6, 1.0, 1.0, 1e6, 1.0, 1.0])
    scaled = measure_consistency(errors * scale, covariances * np.outer(scale, scale))
    np.testing.assert_allclose(scaled.nees, measure_consistency(errors, covariances).nees, rtol=1e-6)


def test_singular_covariances_are_counted_and_left_out():
    covariances = np.stack([np.eye(2), np.ones((2, 2)), np.diag([1.0, 0.0]), np.diag([1.0, np.nan])])
    result = measure_consistency(np.ones((4, 2)), covariances)
    np.testing.assert_allclose(result.nees, [2.0])
    assert result.singular == 3


def test_without_errors_nothing_is_known():
    result = measure_consistency(np.empty((0, 3)), np.empty((0, 3, 3)))
    assert (result.mean_per_dof, result.band, result.inside, result.verdict) == (None,) * 4
    assert {metric.value for metric in consistency_metrics("pose", result)} == {None, 0}


def test_the_plot_of_honest_errors_follows_the_line():
    plot = consistency_plot("pose", measure_consistency(*draws(2000, 6)))
    expected, found = np.array(plot.series[1].x), np.array(plot.series[1].y)
    assert np.all(np.diff(found) >= 0.0)
    middle = slice(100, -100)
    np.testing.assert_allclose(found[middle], expected[middle], rtol=0.1)
