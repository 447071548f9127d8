"""Scores turned into probabilities."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import minimize

from thingmap.detectors.platt import fit_platt, probability


def sample(seed: int = 0, count: int = 200) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    labels = rng.uniform(size=count) < 0.3
    return rng.normal(size=count) + 1.5 * labels, labels


def smoothed(labels: np.ndarray, weights: np.ndarray) -> np.ndarray:
    right, false = weights[labels].sum(), weights[~labels].sum()
    return np.where(labels, (right + 1) / (right + 2), 1 / (false + 2))


def test_the_curve_that_made_the_labels_is_found():
    rng = np.random.default_rng(1)
    scores = rng.normal(0.0, 2.0, 20_000)
    labels = rng.uniform(size=len(scores)) < probability(scores, -2.0, 1.0)
    u, v = fit_platt(scores, labels)
    assert (u, v) == pytest.approx((-2.0, 1.0), abs=0.08)


def test_it_is_the_minimum_that_another_solver_finds():
    scores, labels = sample()
    weights = np.random.default_rng(2).uniform(0.1, 5.0, len(scores))
    target = smoothed(labels, weights)

    def loss(uv: np.ndarray) -> float:
        p = probability(scores, *uv)
        return float(-weights @ (target * np.log(p) + (1 - target) * np.log1p(-p)))

    best = minimize(loss, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-12})
    assert fit_platt(scores, labels, weights) == pytest.approx(tuple(best.x), abs=1e-5)


def test_told_apart_without_a_mistake_it_stays_finite():
    u, v = fit_platt(np.array([-2.0, -1.0, 1.0, 2.0]), np.array([False, False, True, True]))
    assert -10.0 < u < 0.0 and np.isfinite(v)
    assert probability(0.0, u, v) == pytest.approx(0.5)
    # Σ s p = Σ s t at the minimum, with targets 3/4 and 1/4, and p(-s) = 1 - p(s) since all is symmetric
    assert probability(np.array([1.0, 2.0]), u, v) @ [1, 2] == pytest.approx(3 * 0.75)


def test_a_weight_is_so_many_windows_alike():
    scores, labels = sample(count=60)
    times = np.random.default_rng(3).integers(0, 4, len(scores))
    repeated = fit_platt(np.repeat(scores, times), np.repeat(labels, times))
    assert fit_platt(scores, labels, times) == pytest.approx(repeated, abs=1e-7)


def test_heavier_negatives_make_everything_less_probable():
    scores, labels = sample()
    even, heavy = fit_platt(scores, labels), fit_platt(scores, labels, np.where(labels, 1.0, 20.0))
    grid = np.linspace(-2, 4, 7)
    assert (probability(grid, *heavy) < probability(grid, *even)).all()


@given(arrays(np.float64, 12, elements=st.floats(-3, 3, width=16)), st.floats(0.01, 100), st.floats(-50, 50))
def test_the_unit_of_scores_does_not_matter(scores: np.ndarray, factor: float, shift: float):
    labels = np.arange(12) % 3 == 0
    plain, other = fit_platt(scores, labels), fit_platt(scores * factor + shift, labels)
    assert probability(scores * factor + shift, *other) == pytest.approx(probability(scores, *plain), abs=1e-5)


@given(arrays(np.float64, 10, elements=st.floats(-5, 5, width=16)), arrays(np.bool_, 10))
def test_the_mean_probability_is_the_mean_target(scores: np.ndarray, labels: np.ndarray):
    u, v = fit_platt(scores, labels)
    assert u <= 0.0
    assert probability(scores, u, v).mean() == pytest.approx(smoothed(labels, np.ones(10)).mean(), abs=1e-6)


def test_scores_that_say_less_than_nothing_leave_the_share_of_positives():
    scores, labels = sample()
    u, v = fit_platt(-scores, labels)
    assert u == 0.0
    assert probability(3.0, u, v) == pytest.approx(labels.mean(), abs=0.01)


def test_one_kind_or_one_score_only():
    assert fit_platt(np.array([1.0, 2.0]), np.array([True, True])) == pytest.approx((0.0, -np.log(3)), abs=1e-6)
    u, v = fit_platt(np.full(4, 7.0), np.array([True, False, False, False]))
    assert u == 0.0 and probability(7.0, u, v) == pytest.approx((2 / 3 + 3 / 5) / 4)


def test_far_out_scores_overflow_nothing():
    with np.errstate(all="raise"):
        assert probability(np.array([-1e5, 1e5]), -1.0, 0.0).tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("scores", "labels", "weights"),
    [
        ([], [], None),
        ([1.0, 2.0], [True], None),
        ([1.0], [True], [1.0, 1.0]),
        ([np.nan, 1.0], [True, False], None),
        ([1.0, 2.0], [True, False], [1.0, -1.0]),
        ([1.0, 2.0], [True, False], [0.0, 0.0]),
    ],
)
def test_no_sense(scores, labels, weights):
    with pytest.raises(ValueError, match="scores"):
        fit_platt(scores, labels, weights)
