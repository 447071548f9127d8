"""Hits and misses: against numerical integration, the limit of independent views, and what should have been seen."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import beta

from thingmap.factors.missed import DetectionRate

RATE = DetectionRate()
counts = st.floats(0.0, 30.0)


def integrated(prior: tuple[float, float], hits: float, misses: float) -> float:
    """p(hits, misses) with the detection rate integrated out numerically."""

    def joint(r: float) -> float:
        return r**hits * (1.0 - r) ** misses * float(beta.pdf(r, *prior))

    return quad(joint, 0.0, 1.0, epsabs=0.0, epsrel=1e-9, limit=200)[0]


@pytest.mark.parametrize(("hits", "misses"), [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (3.5, 1.2), (0.05, 7.0), (12.0, 9.0)])
def test_the_rate_is_integrated_out(hits, misses):
    expected = np.log(integrated(RATE.object_prior, hits, misses) / integrated(RATE.none_prior, hits, misses))
    assert RATE.log_ratio(hits, misses) == pytest.approx(expected, abs=1e-6)


def test_one_view_is_the_mean_rates_ratio():
    object_mean, none_mean = (a / (a + b) for a, b in (RATE.object_prior, RATE.none_prior))
    assert (object_mean, none_mean) == (pytest.approx(0.67, abs=0.005), pytest.approx(0.17, abs=0.005))
    assert RATE.log_ratio(1.0, 0.0) == pytest.approx(np.log(object_mean / none_mean))
    assert RATE.log_ratio(0.0, 1.0) == pytest.approx(np.log((1.0 - object_mean) / (1.0 - none_mean)))


@settings(deadline=None, derandomize=True)
@given(st.floats(0.0, 10.0), st.floats(0.0, 10.0))
def test_known_rates_make_views_independent(hits, misses):
    """log(1 - P_D) added up is the limit of narrow priors."""
    p, q, sure = 0.8, 0.1, 1e6
    known = DetectionRate((p * sure, (1 - p) * sure), (q * sure, (1 - q) * sure))
    expected = hits * np.log(p / q) + misses * np.log((1 - p) / (1 - q))
    assert known.log_ratio(hits, misses) == pytest.approx(expected, abs=1e-2)


@settings(deadline=None, derandomize=True)
@given(counts, counts, st.floats(0.01, 5.0))
def test_hits_speak_for_an_object_and_misses_against_it(hits, misses, more):
    assert RATE.log_ratio(hits + more, misses) > RATE.log_ratio(hits, misses)
    assert RATE.log_ratio(hits, misses + more) < RATE.log_ratio(hits, misses)
    assert RATE.log_ratio(0.0, 0.0) == 0.0


def test_misses_of_one_object_are_not_independent():
    """A detector that never finds one cup in twenty views says less than twenty times one miss."""
    many, one = RATE.log_ratio(0.0, 20.0), RATE.log_ratio(0.0, 1.0)
    assert 0.8 * 20.0 * one < many < 2.0 * one
    # nor does it matter in which order they came
    assert RATE.log_ratio(5.0, 20.0) < 0.0 < RATE.log_ratio(15.0, 5.0)


@settings(deadline=None, derandomize=True)
@given(st.floats(0.0, 1.0), st.floats(0.0, 400.0), st.floats(0.0, 1.0), st.floats(0.0, 400.0))
def test_less_is_expected_of_what_is_hidden_or_small(visible_a, side_a, visible_b, side_b):
    visible, side = np.array([visible_a, visible_b, visible_a]), np.array([side_a, side_b, side_b])
    factor = RATE.expected(visible, side)
    assert ((factor >= 0.0) & (factor <= 1.0)).all()
    low = RATE.expected(np.minimum(visible[:1], visible[1:2]), np.minimum(side[:1], side[1:2]))[0]
    assert low <= factor.min()


def test_nothing_is_expected_below_the_least_visible_share_and_everything_in_full_view():
    side = np.full(4, 100.0)
    np.testing.assert_array_equal(RATE.expected(np.array([0.0, 0.29, 0.3, 1.0]), side), [0.0, 0.0, 0.0, 1.0])
    assert 0.0 < RATE.expected(np.array([0.5]), side[:1])[0] < 1.0
    full = np.ones(3)
    small = RATE.expected(full, np.array([0.4, 1.0, 4.0]) * RATE.min_pixels)
    assert small[0] == 0.0 and 0.0 < small[1] < 1.0 and small[2] == 1.0
