"""Scores as evidence: who gains from a strong or a weak score, and what occlusion and silence change."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.factors.appearance import TRUNCATION, AppearanceModel

MODEL = AppearanceModel()
scores_or_silence = st.lists(st.one_of(st.floats(0.0, 1.0), st.just(np.nan)), min_size=1, max_size=8)


def own(scores: list[float], occlusion: float = 0.0) -> np.ndarray:
    return MODEL.evidence(np.array(scores), occlusion).own


def background(scores: list[float], occlusion: float = 0.0) -> np.ndarray:
    return MODEL.evidence(np.array(scores), occlusion).background


def test_the_expected_score_falls_linearly_with_occlusion():
    occlusions = np.linspace(0.05, 0.65, 25)
    means, sigmas = zip(*[MODEL.own_parameters(o) for o in occlusions], strict=True)
    fall = (MODEL.mean_occluded - MODEL.mean_visible) / TRUNCATION
    np.testing.assert_allclose(means, MODEL.mean_visible + fall * occlusions, atol=1e-12)
    assert (np.array(sigmas) > 0.0).all()
    assert MODEL.own_parameters(0.9) == MODEL.own_parameters(1.0)


@settings(deadline=None, derandomize=True, max_examples=200)
@given(scores_or_silence, st.floats(0.0, 1.0))
def test_evidence_is_finite_whatever_a_detector_says(scores, occlusion):
    evidence = MODEL.evidence(np.array(scores), occlusion)
    assert evidence.own.shape == evidence.background.shape == (len(scores),)
    assert np.isfinite(evidence.own).all() and np.isfinite(evidence.background).all()


@settings(deadline=None, derandomize=True, max_examples=100)
@given(scores_or_silence, st.floats(0.0, TRUNCATION), st.randoms(use_true_random=False))
def test_the_order_of_the_classes_does_not_matter(scores, occlusion, random):
    order = list(range(len(scores)))
    random.shuffle(order)
    before, after = MODEL.evidence(np.array(scores), occlusion), MODEL.evidence(np.array(scores)[order], occlusion)
    np.testing.assert_allclose(after.own, before.own[order])
    np.testing.assert_allclose(after.background, before.background[order])


def test_a_fair_score_speaks_for_its_class_and_for_an_object():
    evidence = MODEL.evidence(np.array([0.55, 0.03, 0.01]), 0.0)
    assert evidence.own[0] > 2.0 and (evidence.own[1:] < -0.5).all()
    assert evidence.own[0] - evidence.background[0] > 1.5


def test_a_weak_score_is_sooner_a_false_box():
    evidence = MODEL.evidence(np.array([0.12, 0.03, 0.01]), 0.0)
    assert evidence.background[0] - evidence.own[0] > 0.5
    # the same score of something mostly hidden is no such sign
    hidden = MODEL.evidence(np.array([0.12, 0.03, 0.01]), 0.65)
    assert hidden.background[0] - hidden.own[0] < evidence.background[0] - evidence.own[0] - 0.3


@pytest.mark.parametrize(("score", "sign"), [(0.2, 1.0), (0.3, 1.0), (0.6, -1.0), (0.8, -1.0)])
def test_hidden_objects_score_weakly_and_seen_ones_strongly(score, sign):
    by_occlusion = [own([score, 0.02], o)[0] for o in np.linspace(0.05, 0.65, 13)]
    assert (sign * np.diff(by_occlusion) > 0.0).all()
    assert len({background([score, 0.02], o)[0] for o in (0.1, 0.3, 0.6)}) == 1  # false boxes have no occluder


@pytest.mark.parametrize(
    ("scores", "occlusion"),
    [([0.9, 0.1], TRUNCATION + 1e-6), ([0.05, np.nan], 1.0), ([np.nan, np.nan], 0.0), ([np.nan], 0.5)],
)
def test_a_hidden_object_and_a_silent_detector_say_nothing(scores, occlusion):
    evidence = MODEL.evidence(np.array(scores), occlusion)
    assert not evidence.own.any() and not evidence.background.any()
    assert MODEL.evidence(np.array([0.9, 0.1]), TRUNCATION).own.any()


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.floats(0.05, 1.0), st.integers(1, 5), st.floats(0.0, TRUNCATION))
def test_an_unreported_class_scored_somewhere_below_the_best(best, unreported, occlusion):
    """Its likelihood ratio is an average of those of the scores it may have had."""
    silent = MODEL.evidence(np.array([best, *[np.nan] * unreported]), occlusion)
    assert len(set(silent.own[1:].tolist())) == 1
    rest = [0.0] * (unreported - 1)
    told = [MODEL.evidence(np.array([best, s, *rest]), occlusion) for s in np.linspace(0.0, best, 201)]
    for name in ("own", "background"):
        possible = [getattr(t, name)[1] for t in told]
        assert min(possible) - 1e-6 <= getattr(silent, name)[1] <= max(possible) + 1e-6
    only_reported = MODEL.evidence(np.array([best, *[0.0] * unreported]), occlusion)
    assert silent.own[0] == pytest.approx(only_reported.own[0])


def test_silence_after_a_weak_best_says_more_than_after_a_strong_one():
    """A class that scored below 0.1 is unlikely; one that scored below 0.9 may be anything."""
    weak, strong = own([0.1, np.nan])[1], own([0.9, np.nan])[1]
    assert weak < -1.0 < strong < 0.0


def test_scores_beyond_the_unit_interval_count_as_its_ends():
    np.testing.assert_array_equal(own([1.3, -0.2]), own([1.0, 0.0]))


def test_the_true_class_wins_over_a_few_views_of_an_inconstant_detector():
    rng = np.random.default_rng(0)
    right = as_object = 0
    for _ in range(200):
        true, total, excess = int(rng.integers(5)), np.zeros(5), np.zeros(5)
        for _ in range(8):
            scores = np.minimum(np.abs(MODEL.other_sigma * rng.normal(size=5)), 1.0)
            named = true if rng.random() > MODEL.confusion else int(rng.integers(5))
            scores[named] = np.clip(rng.normal(MODEL.mean_visible, MODEL.sigma), 0.0, 1.0)
            evidence = MODEL.evidence(scores, 0.0)
            total += evidence.own
            excess += evidence.background - evidence.own
        right += int(np.argmax(total)) == true
        as_object += excess[true] < 0.0
    assert right >= 190 and as_object >= 190
