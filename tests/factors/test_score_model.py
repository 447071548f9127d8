"""Scores as evidence, by class, template and occlusion: against scipy's densities, and at the model's edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import halfnorm, truncnorm

from thingmap.factors.score_model import BIN_CENTRES, TRUNCATION, ScoreModel
from thingmap.factors.visibility import VolumePart

CLASSES = ("mug", "bowl", "cereal box")


def made_up(classes: tuple[str, ...] = CLASSES, seed: int = 0) -> ScoreModel:
    """Every number differs from every other."""
    rng, rows = np.random.default_rng(seed), len(classes) + 1
    return ScoreModel(
        classes,
        mean=rng.uniform(0.2, 0.8, (rows, 5, 10)),
        sigma=rng.uniform(0.1, 0.3, (rows, 5, 10)),
        background_mean=rng.uniform(0.05, 0.2, (rows, 5)),
        background_sigma=rng.uniform(0.1, 0.2, (rows, 5)),
        other_sigma=rng.uniform(0.03, 0.1, 5),
        confusion=rng.uniform(0.05, 0.3, 5),
        platt_ab=rng.uniform((-12.0, 2.0), (-8.0, 4.0), (5, 2)),
        linear_range=rng.uniform((0.1, 0.4), (0.2, 0.6), (5, 2)),
    )


MODEL = made_up()
scores_or_silence = st.lists(st.one_of(st.floats(-0.5, 1.5), st.just(np.nan)), min_size=3, max_size=3)


def densities(model: ScoreModel, k: int, occlusion: float, part: int):
    """own, background and other as the module's docstring has them, for one class, out of scipy's distributions."""

    def normal(mean: float, sigma: float):
        return truncnorm(-mean / sigma, (1.0 - mean) / sigma, mean, sigma).pdf

    mean, sigma = (np.interp(occlusion, BIN_CENTRES, table[k, part]) for table in (model.mean, model.sigma))
    own, false = normal(mean, sigma), normal(model.background_mean[k, part], model.background_sigma[k, part])
    foreign, c = halfnorm(scale=model.other_sigma[part]), model.confusion[part]
    by_mistake = c / (len(model.classes) - 1)
    return (
        lambda s: (1.0 - c) * own(s) + c * foreign.pdf(s) / foreign.cdf(1.0),
        false,
        lambda s: (1.0 - by_mistake) * foreign.pdf(s) / foreign.cdf(1.0) + by_mistake,
    )


@pytest.mark.parametrize("part", VolumePart)
@pytest.mark.parametrize("occlusion", [0.0, 0.05, 0.1, 0.33, 0.7])
def test_reported_scores_are_weighed_by_the_densities_of_their_class(part, occlusion):
    scores = np.array([0.45, 0.2, 0.02])
    evidence = MODEL.evidence(scores, occlusion, part)
    for k, s in enumerate(scores):
        own, false, other = densities(MODEL, k, occlusion, part)
        assert evidence.own[k] == pytest.approx(np.log(own(s) / other(s)), abs=1e-4)
        assert evidence.background[k] == pytest.approx(np.log(false(s) / other(s)), abs=1e-4)


@pytest.mark.parametrize("best", [0.08, 0.4, 1.0])
def test_an_unreported_class_scored_somewhere_below_the_best(best):
    evidence = MODEL.evidence(np.array([np.nan, best, np.nan]), 0.2, 3)
    for k in (0, 2):
        own, false, other = (quad(density, 0.0, best)[0] for density in densities(MODEL, k, 0.2, 3))
        assert evidence.own[k] == pytest.approx(np.log(own / other), abs=1e-4)
        assert evidence.background[k] == pytest.approx(np.log(false / other), abs=1e-4)


def test_gaussians_are_interpolated_between_the_centres_of_the_bins():
    for b, occlusion in enumerate(BIN_CENTRES):
        mean, sigma = MODEL.own_parameters(2, occlusion)
        np.testing.assert_allclose(mean, MODEL.mean[:, 2, b], atol=1e-12)
        np.testing.assert_allclose(sigma, MODEL.sigma[:, 2, b], atol=1e-12)
    mean, sigma = MODEL.own_parameters(2, 0.325)
    np.testing.assert_allclose(mean, 0.25 * MODEL.mean[:, 2, 2] + 0.75 * MODEL.mean[:, 2, 3])
    np.testing.assert_allclose(sigma, 0.25 * MODEL.sigma[:, 2, 2] + 0.75 * MODEL.sigma[:, 2, 3])


@pytest.mark.parametrize(("occlusion", "outer"), [(0.0, 0.05), (0.02, 0.05), (0.99, 0.95), (1.0, 0.95)])
def test_gaussians_are_constant_beyond_the_outer_bins(occlusion, outer):
    for beyond, at in zip(MODEL.own_parameters(0, occlusion), MODEL.own_parameters(0, outer), strict=True):
        np.testing.assert_allclose(beyond, at, atol=1e-12)


@pytest.mark.parametrize(
    ("scores", "occlusion"),
    [([0.9, 0.1, 0.0], TRUNCATION + 1e-6), ([0.9, 0.1, 0.0], np.nan), ([np.nan] * 3, 0.0), ([0.05, np.nan, 0.0], 1.0)],
)
def test_a_hidden_object_and_a_silent_detector_say_nothing(scores, occlusion):
    evidence = MODEL.evidence(np.array(scores), occlusion)
    assert not evidence.own.any() and not evidence.background.any()
    assert MODEL.evidence(np.array([0.9, 0.1, 0.0]), TRUNCATION).own.all()


@settings(deadline=None, derandomize=True, max_examples=200)
@given(
    scores_or_silence,
    st.floats(0.0, 1.0),
    st.sampled_from([0.0, 0.5, 1.0]),
    st.sampled_from([1e-3, 0.1, 10.0]),
    st.sampled_from([0.0, 0.2, 1.0]),
)
def test_evidence_is_finite_at_the_edges_of_every_number(scores, occlusion, mean, sigma, confusion):
    model = replace(
        MODEL,
        mean=np.full((4, 5, 10), mean),
        sigma=np.full((4, 5, 10), sigma),
        background_mean=np.full((4, 5), 1.0 - mean),
        background_sigma=np.full((4, 5), sigma),
        other_sigma=np.full(5, sigma),
        confusion=np.full(5, confusion),
    )
    evidence = model.evidence(np.array(scores), occlusion)
    assert np.isfinite(evidence.own).all() and np.isfinite(evidence.background).all()


@settings(deadline=None, derandomize=True, max_examples=50)
@given(scores_or_silence, st.floats(0.0, TRUNCATION), st.permutations(range(3)), st.sampled_from(list(VolumePart)))
def test_a_detector_may_have_its_classes_in_any_order(scores, occlusion, order, part):
    before = MODEL.evidence(np.array(scores), occlusion, part)
    after = MODEL.bind([CLASSES[k] for k in order]).evidence(np.array(scores)[order], occlusion, part)
    np.testing.assert_allclose(after.own, before.own[order])
    np.testing.assert_allclose(after.background, before.background[order])


def test_classes_that_were_not_learned_get_the_pooled_row():
    bound = MODEL.bind(["sofa", "Cereal_Box", "lamp"])
    assert bound.classes == ("sofa", "Cereal_Box", "lamp")
    for name in ("mean", "sigma", "background_mean", "background_sigma"):
        np.testing.assert_array_equal(getattr(bound, name), getattr(MODEL, name)[[3, 2, 3, 3]])
    np.testing.assert_array_equal(bound.confusion, MODEL.confusion)


def test_a_detector_may_call_two_of_its_classes_nearly_the_same():
    bound = MODEL.bind(["mug", "Mug"])
    np.testing.assert_array_equal(bound.mean, MODEL.mean[[0, 0, 3]])


def test_scores_beyond_the_unit_interval_count_as_its_ends():
    outside, ends = MODEL.evidence(np.array([1.3, -0.2, 0.4]), 0.1), MODEL.evidence(np.array([1.0, 0.0, 0.4]), 0.1)
    np.testing.assert_array_equal(outside.own, ends.own)


def test_views_of_an_object_speak_for_an_object_and_false_boxes_against():
    """Gibbs: the density that scores come from is the likelier one on average, whatever the numbers."""
    rng = np.random.default_rng(1)
    for part in VolumePart:
        mean, sigma = (table[0] for table in MODEL.own_parameters(part, 0.25))
        as_object = np.clip(rng.normal(mean, sigma, 400), 0.0, 1.0)
        as_false = np.abs(rng.normal(MODEL.background_mean[0, part], MODEL.background_sigma[0, part], 400))
        excess = [
            np.mean(
                [(e.own - e.background)[0] for e in (MODEL.evidence(np.array([s, 0, 0]), 0.25, part) for s in scores)]
            )
            for scores in (as_object, as_false)
        ]
        assert excess[0] > 0.1 and excess[1] < -0.1


def test_the_linear_potential_runs_from_false_boxes_to_objects_in_full_view():
    low, high = MODEL.linear_range[1]
    scores = np.array([0.0, low, (low + high) / 2.0, high, 1.0])
    np.testing.assert_allclose(MODEL.linear(scores, 1), [-1.0, -1.0, 0.0, 1.0, 1.0], atol=1e-12)


def test_platt_scaling_is_a_logistic_curve():
    A, B = MODEL.platt_ab[4]
    scores = np.array([0.0, -B / A, 1.0])
    probability = MODEL.platt(scores, 4)
    assert probability[1] == pytest.approx(0.5)
    np.testing.assert_allclose(np.log(1.0 / probability - 1.0), A * scores + B, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"mean": np.full((4, 5, 9), 0.5)}, r"mean of shape \(4, 5, 9\) instead of \(4, 5, 10\)"),
        ({"sigma": np.zeros((4, 5, 10))}, r"sigma\[0, 0, 0\] = 0 instead of a number from 0.001"),
        ({"background_mean": np.full((4, 5), np.nan)}, r"background_mean\[0, 0\] = nan"),
        ({"confusion": [0.1, 0.1, 1.5, 0.1, 0.1]}, r"confusion\[2\] = 1.5"),
        ({"platt_ab": np.full((5, 2), np.inf)}, "platt_ab"),
        ({"linear_range": np.full((5, 2), 0.5)}, "linear_range"),
        ({"classes": ("mug", "bowl")}, "mean of shape"),
    ],
)
def test_wrong_numbers_are_refused(change, says):
    with pytest.raises(ValueError, match=says):
        replace(MODEL, **change)


def test_one_score_for_each_class():
    with pytest.raises(ValueError, match=r"scores must be \(3,\)"):
        MODEL.evidence(np.zeros(2), 0.0)


def test_a_model_is_never_written_to():
    with pytest.raises(ValueError, match="read-only"):
        MODEL.mean[0, 0, 0] = 0.5
