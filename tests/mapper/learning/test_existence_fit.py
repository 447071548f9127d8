"""Weights and rates fitted to landmarks that were drawn from a known model, by its own story of how evidence arises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import softmax

from thingmap.factors.existence import Evidence, ExistenceModel
from thingmap.mapper.evaluation.uncertainty.calibration import bin_claims
from thingmap.mapper.learning.existence_fit import LEAST, MOST, fit_existence
from thingmap.mapper.learning.landmarks import LandmarkSamples

K = 4
TRUE = ExistenceModel(null_prior=0.7, object_rate=(5.0, 2.0), none_rate=(1.0, 4.0), surface=0.3)
WEIGHTS = ("weight_score", "weight_rate", "weight_free", "weight_depth", "weight_size")
NAMED, HIGH, FREE, DEPTH = 1.5, 0.8, 1.5, 2.0  # sigmas between what an object and what none gives


def draw(count: int, seed: int) -> LandmarkSamples:
    """Landmarks of one view each: the model is exact, all weights being 1."""
    rng = np.random.default_rng(seed)
    truth = np.where(rng.random(count) < TRUE.null_prior, -1, rng.integers(K, size=count))
    is_object, rows = truth >= 0, np.arange(count)

    a, b = (np.where(is_object, *pair) for pair in zip(TRUE.object_rate, TRUE.none_rate, strict=True))
    views = rng.integers(1, 9, count)
    hits = rng.binomial(views, rng.beta(a, b)).astype(np.float64)

    steady = is_object & (rng.random(count) < TRUE.steady_confusion)
    looks_like = np.where(is_object & ~steady, truth, (truth + rng.integers(1, K, count)) % K)
    looks_like = np.where(is_object, looks_like, rng.integers(K, size=count))
    named = rng.normal(0.0, 1.0, (count, K))
    named[rows, looks_like] += NAMED
    height = rng.normal(np.where(is_object & ~steady, HIGH, 0.0), 1.0)  # of scores: as an object's, or as background's
    excess = np.tile(_log_ratio(height, HIGH)[:, None], (1, K))
    own = _log_ratio(named, NAMED) + excess

    def at_its_place(apart: float) -> np.ndarray:
        filled = is_object | (rng.random(count) < TRUE.surface)
        return _log_ratio(rng.normal(np.where(filled, apart, 0.0), 1.0), apart)

    free, depth = at_its_place(FREE), at_its_place(DEPTH)
    size = rng.normal(truth + 1.0, 1.0)
    log_size = -0.5 * (size[:, None] - np.arange(K + 1.0)) ** 2
    evidence = Evidence(own, -excess, np.ones(count), hits, views - hits, free, depth, log_size)
    geometry = np.zeros((count, 3, 3)), np.zeros((count, 3)), np.zeros((count, 3))
    return LandmarkSamples(evidence, *geometry, label=truth, scene=np.zeros(count, dtype=np.int64))


def _log_ratio(x: np.ndarray, mean: float) -> np.ndarray:
    """log N(x; mean, 1) - log N(x; 0, 1)."""
    return mean * x - mean**2 / 2.0


def changed(samples: LandmarkSamples, **evidence: np.ndarray) -> LandmarkSamples:
    return replace(samples, evidence=replace(samples.evidence, **evidence))


def posterior(model: ExistenceModel, samples: LandmarkSamples) -> np.ndarray:
    return softmax(model.log_belief(samples.evidence), axis=1)


def log_loss(model: ExistenceModel, samples: LandmarkSamples) -> float:
    return float(-np.log(posterior(model, samples)[np.arange(len(samples)), samples.label + 1]).mean())


@pytest.fixture(scope="module")
def samples() -> LandmarkSamples:
    return draw(1500, seed=1)


@pytest.fixture(scope="module")
def fresh() -> LandmarkSamples:
    return draw(8000, seed=2)


@pytest.fixture(scope="module")
def fitted(samples) -> ExistenceModel:
    return fit_existence(samples)


def test_probabilities_of_fresh_landmarks_mean_what_they_say(fitted, fresh):
    p, true = posterior(fitted, fresh), fresh.label >= 0
    assert bin_claims(1.0 - p[:, 0], true, 10).expected_error < 0.03
    named = p[true, 1:] / p[true, 1:].sum(axis=1, keepdims=True)
    right = named.argmax(axis=1) == fresh.label[true]
    assert bin_claims(named.max(axis=1), right, 10).expected_error < 0.03


def test_the_fit_is_as_good_as_the_model_that_it_was_drawn_from(fitted, fresh):
    best, before = log_loss(TRUE, fresh), log_loss(ExistenceModel(), fresh)
    assert before - best > 0.01  # or there is nothing to show
    assert log_loss(fitted, fresh) - best < 0.35 * (before - best)
    assert (1.0 - posterior(fitted, fresh)[:, 0]).mean() == pytest.approx((fresh.label >= 0).mean(), abs=0.03)
    assert [getattr(fitted, name) for name in WEIGHTS] == pytest.approx([1.0] * 5, abs=0.4)


@pytest.mark.parametrize(
    ("weight", "terms"),
    [
        ("weight_score", ("own", "excess")),
        ("weight_free", ("free",)),
        ("weight_depth", ("depth",)),
        ("weight_size", ("log_size",)),
    ],
)
def test_evidence_of_other_landmarks_is_useless_and_gets_a_small_weight(samples, weight, terms):
    other = np.random.default_rng(0).permutation(len(samples))
    model = fit_existence(changed(samples, **{term: getattr(samples.evidence, term)[other] for term in terms}))
    rest = [getattr(model, name) for name in WEIGHTS if name != weight]
    assert getattr(model, weight) < 0.6 * min(rest)


def test_what_is_said_twice_counts_half(samples, fitted):
    doubled = fit_existence(changed(samples, log_size=2.0 * samples.evidence.log_size))
    assert doubled.weight_size == pytest.approx(fitted.weight_size / 2.0, rel=0.1)
    assert doubled.weight_depth == pytest.approx(fitted.weight_depth, rel=0.15)


def test_two_kinds_that_say_the_same_share_the_weight(samples, fresh):
    """What matters is what they say together: as sure as one of them alone, and not twice as sure."""
    nothing, both = np.zeros(len(samples)), changed(fresh, free=fresh.evidence.depth)
    once = fit_existence(changed(samples, free=nothing))
    twice = fit_existence(changed(samples, free=samples.evidence.depth))
    assert twice.weight_free == pytest.approx(twice.weight_depth, rel=0.1)
    assert twice.weight_free < 0.75 * once.weight_depth
    expected = posterior(once, changed(fresh, free=np.zeros(len(fresh))))
    assert np.abs(posterior(twice, both) - expected).mean() < 0.01


def test_a_kind_that_says_nothing_keeps_its_weight(samples):
    model = fit_existence(changed(samples, log_size=np.zeros_like(samples.evidence.log_size)))
    assert model.weight_size == pytest.approx(1.0, abs=0.01)


def test_the_order_of_samples_does_not_matter(samples, fitted, fresh):
    shuffled = fit_existence(samples.select(np.random.default_rng(0).permutation(len(samples))))
    np.testing.assert_allclose(posterior(shuffled, fresh), posterior(fitted, fresh), atol=0.02)


def test_the_same_samples_give_the_same_model():
    few = draw(200, seed=3)
    assert fit_existence(few) == fit_existence(few)


def test_samples_without_any_doubt_do_not_run_away():
    """Every size is that of the true class: the more it weighs, the better."""
    few = draw(60, seed=4)
    sure = -np.ones((60, K + 1))
    sure[np.arange(60), few.label + 1] = 0.0
    sized = changed(few, log_size=sure)
    model = fit_existence(sized)
    assert 2.0 < model.weight_size <= MOST
    assert all(LEAST <= getattr(model, name) <= MOST for name in WEIGHTS)
    assert log_loss(model, sized) < log_loss(ExistenceModel(), sized)
