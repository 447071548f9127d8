from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.mapper.learning.config import LearningConfig
from thingmap.mapper.learning.fit_platt import fit_platt
from thingmap.mapper.learning.fit_scores import fit_scores, soft_votes

ALL = np.arange(3)
CONFIG = LearningConfig()


@given(st.floats(0.0, 1.0))
def test_a_vote_is_shared_by_the_two_nearest_bins(occlusion):
    votes = soft_votes(np.array([occlusion]))[0]
    assert votes.sum() == pytest.approx(1.0)
    voted = np.flatnonzero(votes)
    assert len(voted) <= 2 and np.ptp(voted) <= 1
    inner = np.clip(occlusion, 0.05, 0.95)
    assert votes @ (np.arange(10) + 0.5) / 10 == pytest.approx(inner)  # so a line is learned without a bias


def test_it_finds_the_line_that_scores_fall_along(make_samples):
    model = fit_scores(make_samples(trials=12000), ALL, CONFIG).model
    for occlusion in (0.05, 0.35, 0.65):
        mean, sigma = model.own_parameters(0, occlusion)
        assert mean == pytest.approx(0.7 - 0.4 * occlusion, abs=0.02)
        assert sigma == pytest.approx(0.08, abs=0.015)
    assert model.background_mean[:, 0] == pytest.approx(0.2, abs=0.06)
    assert model.other_sigma[0] == pytest.approx(0.03, abs=0.005)
    assert model.confusion[0] < 0.02
    assert model.platt(np.array([0.2]))[0] < 0.3 < 0.9 < model.platt(np.array([0.6]))[0]
    assert model.linear(np.array([0.1, 0.9])).tolist() == [-1.0, 1.0]


def test_halves_without_detections_take_the_numbers_of_the_whole(make_samples):
    fitted = fit_scores(make_samples(), ALL, CONFIG)
    assert np.array_equal(fitted.model.mean[:, 3], fitted.model.mean[:, 0])
    assert fitted.votes[:, 1:].sum() == 0.0 and fitted.votes[-1, 0].sum() == pytest.approx(fitted.votes[:-1, 0].sum())


def test_a_rare_class_is_pooled_and_a_common_one_is_its_own(make_samples):
    samples = make_samples(trials=6000)
    rare = np.flatnonzero(samples.class_id == 2)
    scores = samples.scores.copy()
    high = samples.found[:, None] & (np.arange(3) == samples.class_id[:, None]) & (samples.class_id > 0)[:, None]
    scores[high] = 0.95
    keep = np.ones(len(scores), dtype=bool)
    keep[rare[samples.found[rare]]] = False
    keep[rare[samples.found[rare]][:4]] = True
    fewer = {name: getattr(samples, name)[keep] for name in ("class_id", "part", "visible", "side_px", "scene")}
    model = fit_scores(
        replace(samples, **fewer, object_id=samples.object_id[keep], scores=scores[keep]), ALL, CONFIG
    ).model
    cup, bowl, book, pooled = model.mean[:, 0, 1]
    assert bowl == pytest.approx(0.95, abs=0.03) and cup == pytest.approx(0.64, abs=0.04)
    assert abs(book - pooled) < 0.4 * (0.95 - pooled)


def test_empty_bins_take_from_their_neighbours(make_samples):
    samples = make_samples()
    gap = (samples.occlusion > 0.2) & (samples.occlusion < 0.5)
    scores = samples.scores.copy()
    scores[gap] = np.nan
    fitted = fit_scores(replace(samples, scores=scores), ALL, CONFIG)
    assert fitted.votes[-1, 0, 3] == 0.0
    pooled = fitted.model.mean[-1, 0]
    assert pooled[1] > pooled[3] > pooled[5]
    assert pooled[3] == pytest.approx(0.7 - 0.4 * 0.35, abs=0.04)


def test_detectors_that_report_the_best_class_only(make_samples):
    samples = make_samples(trials=8000)
    scores, false = (np.where(x < np.nanmax(np.nan_to_num(x), axis=1, keepdims=True), np.nan, x) for x in
                     (samples.scores, samples.false_scores))  # fmt: skip
    model = fit_scores(replace(samples, scores=scores, false_scores=false), ALL, CONFIG).model
    assert model.own_parameters(0, 0.35)[0] == pytest.approx(0.56, abs=0.03)
    assert model.other_sigma[0] == pytest.approx(0.05)  # nothing is known of it: the generic number


def test_detections_of_hidden_objects_are_background(make_samples):
    samples = make_samples()
    part, scores = samples.background()
    hidden = samples.found & (samples.occlusion > 0.7)
    assert hidden.any() and len(part) == len(scores) == len(samples.false_part) + hidden.sum()


def test_platt_is_calibrated_and_finite():
    rng = np.random.default_rng(3)
    score = rng.uniform(0.0, 1.0, 20000)
    right = rng.random(20000) < 1.0 / (1.0 + np.exp(-8.0 * score + 3.0))
    assert fit_platt(score[right], score[~right], np.zeros(2)) == pytest.approx([-8.0, 3.0], abs=0.25)
    assert np.isfinite(fit_platt(np.array([0.9, 0.8]), np.array([0.1]), np.zeros(2))).all()
    assert fit_platt(np.array([0.9]), np.zeros(0), np.array([1.0, 2.0])).tolist() == [1.0, 2.0]


def test_platt_of_scores_that_say_less_than_nothing_is_the_share_of_right_ones():
    A, B = fit_platt(np.full(30, 0.2), np.full(10, 0.8), np.zeros(2))
    assert A == 0.0
    assert 1.0 / (1.0 + np.exp(B)) == pytest.approx(0.75, abs=0.02)
