import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from thingmap.mapper.map.region import Ball, Box, as_region, probability_inside

UNIT = Box(np.zeros(3), np.ones(3))


@given(
    st.tuples(*[st.floats(-0.5, 1.5)] * 3).map(np.array),
    st.tuples(*[st.floats(1e-4, 0.7)] * 3).map(np.array),
)
@settings(max_examples=60)
def test_independent_axes_have_a_product_of_intervals(mean, std):
    exact = np.prod(norm.cdf((1.0 - mean) / std) - norm.cdf(-mean / std))
    assert probability_inside(UNIT, mean, np.diag(std**2)) == pytest.approx(exact, abs=0.002)


@pytest.mark.parametrize("region", [UNIT, Ball(np.array([0.5, 0.2, 0.4]), 0.45)])
@pytest.mark.parametrize("seed", range(4))
def test_correlated_axes_agree_with_sampling(region, seed):
    rng = np.random.default_rng(seed)
    A = 0.4 * rng.normal(size=(3, 3))
    mean, covariance = rng.uniform(0.0, 1.0, 3), A @ A.T
    samples = rng.multivariate_normal(mean, covariance, 200_000)
    if isinstance(region, Box):
        inside = np.all((samples >= region.low) & (samples <= region.high), axis=1)
    else:
        inside = np.linalg.norm(samples - region.centre, axis=1) <= region.radius
    assert probability_inside(region, mean, covariance) == pytest.approx(inside.mean(), abs=0.004)


def test_a_point_without_uncertainty_is_in_or_out():
    nothing = np.zeros((3, 3))
    for region in (UNIT, Ball(np.full(3, 0.5), 0.6)):
        assert probability_inside(region, np.full(3, 0.5), nothing) == 1.0
        assert probability_inside(region, np.array([0.5, 0.5, 1.2]), nothing) == 0.0


def test_a_flat_position_still_integrates():
    covariance = np.diag([0.04, 0.0, 0.0])
    assert probability_inside(UNIT, np.array([1.0, 0.5, 0.5]), covariance) == pytest.approx(0.5, abs=1e-6)
    assert probability_inside(UNIT, np.array([0.5, 1.5, 0.5]), covariance) == 0.0


@pytest.mark.parametrize(
    "value", [((0, 0, 0), (1, 1)), ((1, 0, 0), (0, 1, 1)), ((0, 0, 0), -1.0), "box", ((0, 0, 0),), 3.0]
)
def test_what_is_no_region_is_refused(value):
    with pytest.raises(ValueError, match="a region is"):
        as_region(value)
