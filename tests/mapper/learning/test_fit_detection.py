from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit, logit

from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.mapper.learning.calibration import calibrate, cross_validate
from thingmap.mapper.learning.config import LearningConfig
from thingmap.mapper.learning.fit_detection import fit_detection

ALL = np.arange(3)
CONFIG = LearningConfig()


def test_it_finds_the_rate_by_visible_share_and_size(make_samples, true_rate):
    model = fit_detection(make_samples(trials=20000), ALL, CONFIG)
    visible, side_px = (grid.ravel() for grid in np.meshgrid(np.linspace(0.05, 0.95, 7), [20.0, 32.0, 64.0, 110.0]))
    assert model.probability(visible, side_px) == pytest.approx(true_rate(visible, side_px), abs=0.05)


def test_beyond_what_was_seen_it_goes_on_as_the_generic_model(make_samples):
    model = fit_detection(make_samples(), ALL, CONFIG)
    assert model.probability(0.5, 300.0) == model.probability(0.5, 128.0)
    assert model.probability(0.5, 5.0) < model.probability(0.5, 16.0)


def test_classes_that_are_hard_to_find_differ_and_rare_ones_are_pooled(make_samples, true_rate):
    samples = make_samples(trials=9000)
    rate = true_rate(samples.visible, samples.side_px)
    harder = expit(logit(rate) - 2.0)
    lost = (samples.class_id == 1) & (np.random.default_rng(7).random(len(rate)) > harder / rate)
    samples = replace(samples, scores=np.where(lost[:, None], np.nan, samples.scores))
    model = fit_detection(samples, ALL, CONFIG)
    assert model.intercept[1, 0] - model.intercept[0, 0] == pytest.approx(-2.0, abs=0.4)
    at = np.array([0.5]), np.array([40.0])
    assert model.probability(*at, posterior=np.eye(3)[[1]]) == pytest.approx(
        expit(logit(true_rate(*at)) - 2.0), abs=0.05
    )
    few = samples.of_scenes([0])
    rare = (few.class_id != 1) | (np.cumsum(few.class_id == 1) <= 3)
    kept = {
        n: getattr(few, n)[rare] for n in ("class_id", "part", "visible", "side_px", "scores", "scene", "object_id")
    }
    pooled = fit_detection(replace(few, **kept), ALL, CONFIG).intercept[:, 0]
    assert abs(pooled[1] - pooled[-1]) < 1.0


def test_a_few_trials_leave_the_generic_curves(make_samples):
    model, generic = fit_detection(make_samples(trials=12), ALL, CONFIG), generic_evidence_model().detection
    assert model.visible[0] == pytest.approx(generic.visible[0], abs=0.5)
    assert model.probability(0.1, 64.0) < 0.6 * model.probability(1.0, 64.0)


def test_a_template_that_finds_nothing_has_a_low_and_finite_rate(make_samples):
    samples = make_samples(parts=2)
    scores = np.where((samples.part == 1)[:, None], np.nan, samples.scores)
    model = fit_detection(replace(samples, scores=scores), ALL, CONFIG)
    assert 0.0 < model.probability(1.0, 64.0, part=1) < 0.01
    assert np.isfinite(model.intercept).all()


def test_calibration_is_that_of_sequences_left_out(make_samples):
    samples = make_samples(trials=8000)
    result = cross_validate(samples, ALL, CONFIG)[0]
    assert result.ece < 0.03 and result.log_loss < 0.75 * result.base_loss
    assert result.trials.sum() == len(samples.part)
    # One sequence in which the detector is blind cannot be foreseen from the others.
    scores = np.where((samples.scene == 0)[:, None], np.nan, samples.scores)
    assert cross_validate(replace(samples, scores=scores), ALL, CONFIG)[0].ece > 0.1
    assert cross_validate(samples.of_scenes([2]), ALL, CONFIG) == {}


def test_calibration_error_of_known_numbers():
    found = np.array([True, False, True, True])
    result = calibrate(np.array([0.55, 0.55, 1.0, 0.95]), found)
    assert result.ece == pytest.approx((2 * 0.05 + 2 * 0.025) / 4)
    assert result.trials.tolist() == [0, 0, 0, 0, 0, 2, 0, 0, 0, 2]
    assert result.base_loss == pytest.approx(-(0.75 * np.log(0.75) + 0.25 * np.log(0.25)))
