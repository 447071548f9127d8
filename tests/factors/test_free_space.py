"""Free space: its densities by hand, its signs, and how little a surface can say however often it is seen."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import beta, halfnorm

from thingmap.factors.free_space import FreeSpace

MODEL = FreeSpace()


@pytest.mark.parametrize("model", [MODEL, FreeSpace(sigma=0.1, bound=20.0)])
def test_an_object_s_free_ratio_is_half_normal(model):
    free = np.linspace(0.0, 1.0, 21)
    expected = np.maximum(halfnorm.logpdf(free, scale=model.sigma), -model.bound)
    np.testing.assert_allclose(model.log_likelihood(free), expected, atol=1e-12)
    density = quad(lambda f: float(np.exp(model.log_likelihood(np.array([f]))[0])), 0.0, 1.0)[0]
    assert density == pytest.approx(1.0, abs=0.02)  # as the uniform one it is weighed against


@settings(deadline=None, derandomize=True)
@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20), st.floats(0.05, 0.6))
def test_more_free_space_never_speaks_for_an_object(free, sigma):
    likelihoods = FreeSpace(sigma).log_likelihood(np.sort(free))
    assert likelihoods.shape == (len(free),)
    assert (np.diff(likelihoods) <= 0.0).all()
    assert (likelihoods >= -MODEL.bound).all()


def test_a_filled_volume_speaks_for_an_object_and_an_empty_one_against():
    assert MODEL.log_likelihood(np.array([0.2]))[0] > 0.0 > MODEL.log_likelihood(np.array([0.6]))[0]


def test_nothing_to_judge_is_nothing_said():
    assert MODEL.log_likelihood(np.empty(0)).shape == (0,)


@settings(deadline=None, derandomize=True)
@given(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=20), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_more_free_space_and_less_of_it_usually_speak_for_removal(free, usual, usually_more):
    free = np.sort(free)
    ratios = MODEL.removed(free, usual)
    assert ratios.shape == free.shape
    assert (np.diff(ratios) >= 0.0).all()
    assert (np.abs(ratios) <= MODEL.bound).all()
    assert (MODEL.removed(free, max(usual, usually_more)) <= ratios).all()


def test_removal_is_a_ratio_of_densities():
    model = FreeSpace(bound=100.0)
    free, usual = np.array([0.1, 0.2, 0.5, 0.9]), np.array([0.2, 0.2, 0.1, 0.6])
    gone, there = beta.logpdf(free, model.removed_shape, 1.0), halfnorm.logpdf([0.0, 0.0, 0.4, 0.3], scale=0.13)
    np.testing.assert_allclose(model.removed(free, usual), gone - there, atol=1e-12)


def test_a_thing_with_gaps_is_not_gone_and_an_empty_place_is():
    assert MODEL.removed(np.array([1.0]), 0.1)[0] == MODEL.bound
    assert MODEL.removed(np.array([0.9]), 0.1)[0] == MODEL.bound
    assert MODEL.removed(np.array([0.0]), 0.1)[0] == -MODEL.bound
    assert (MODEL.removed(np.array([0.1, 0.3, 0.5]), np.array([0.1, 0.3, 0.5])) < -1.0).all()
    assert MODEL.removed(np.array([1.0]), 1.0)[0] < 0.0  # a volume that is always empty never tells
    assert MODEL.removed(np.empty(0), np.empty(0)).shape == (0,)
