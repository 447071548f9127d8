"""Points much surer than a ball is wide."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ncx2

from thingmap.mapper.map.region import Ball, probability_inside
from thingmap.mapper.queries.narrow_ball import narrow_in_ball

BALL = Ball(np.array([1.0, -2.0, 0.5]), 1.0)
stds = st.floats(0.005, 0.3)


@given(st.floats(0.05, 1.5), st.floats(0.002, 0.12))
def test_equal_axes_have_a_closed_form(distance: float, std: float):
    """|x - centre|^2 / std^2 is chi-square of 3 degrees of freedom about (distance / std)^2."""
    mean = BALL.centre + distance * np.array([0.6, 0.0, 0.8])
    inside = narrow_in_ball(BALL, mean[None], std**2 * np.eye(3)[None])[0]
    assert inside == pytest.approx(ncx2.cdf(1.0 / std**2, 3, (distance / std) ** 2), abs=2e-5)


@given(st.integers(0, 2**32 - 1), st.tuples(stds, stds, stds), st.floats(0.5, 1.3))
@settings(max_examples=100, deadline=None)
def test_as_the_integral_over_many_lines_wherever_it_answers(seed: int, axes: tuple[float, ...], distance: float):
    rng = np.random.default_rng(seed)
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    covariance = R @ np.diag(np.square(axes)) @ R.T
    covariance = (covariance + covariance.T) / 2.0
    u = rng.normal(size=3)
    mean = BALL.centre + distance * u / np.linalg.norm(u)
    inside = narrow_in_ball(BALL, mean[None], covariance[None])[0]
    assert np.isnan(inside) or inside == pytest.approx(probability_inside(BALL, mean, covariance), abs=0.003)


def test_it_says_where_it_does_not_answer():
    off, at_centre = BALL.centre + np.array([0.9, 0.0, 0.0]), BALL.centre
    small, wide, flat = 0.02**2 * np.eye(3), 0.5**2 * np.eye(3), np.diag([0.0, 0.01, 0.01])
    along_the_surface = np.diag([0.002, 0.2, 0.2]) ** 2
    covariances = np.array([small, small, wide, flat, along_the_surface])
    inside = narrow_in_ball(BALL, np.array([off, at_centre, off, off, off]), covariances)
    assert np.isnan(inside).tolist() == [False, True, True, True, True]
