"""The second stage as a whole, with made-up landmarks: what it looks at, when it gives up, and what it says."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.factors.existence import Evidence
from thingmap.mapper.learning import existence
from thingmap.mapper.learning.existence import FEWEST, ROUNDS, LearnedExistence, learn_existence
from thingmap.mapper.learning.landmarks import LandmarkSamples
from thingmap.mapper.learning.learn import learn
from thingmap.mapper.learning.page import render_page

CLASSES = ("cup", "bowl", "book")
MODEL = generic_evidence_model()
FRAMES = 7  # of every made-up sequence


def scene(number: int, complete: bool = True):
    """A sequence and its detector; the number tells where its objects are."""
    sequence, centers = range(FRAMES), np.full((2, 3), float(number))
    return SimpleNamespace(name="room", sequence=sequence, centers=centers, complete=complete), None


def records(count: int, seed: int, objects: float = 0.5) -> LandmarkSamples:
    """Objects are found in most of their views, false ones in few; scores name the class three times out of four."""
    rng = np.random.default_rng(seed)
    label = np.where(rng.random(count) < objects, rng.integers(3, size=count), -1)
    views = rng.integers(2, 9, count)
    hits = rng.binomial(views, np.where(label >= 0, 0.7, 0.2)).astype(np.float64)
    named = np.where((label >= 0) & (rng.random(count) < 0.75), label, rng.integers(3, size=count))
    own = np.zeros((count, 3))
    own[np.arange(count), named] = 2.0
    nothing = np.zeros(count)
    evidence = Evidence(own, 0.0 * own, nothing + 1.0, hits, views - hits, nothing, nothing, np.zeros((count, 4)))
    sizes = rng.normal(-2.5, 0.4, (count, 3))
    geometry = np.tile(np.eye(3), (count, 1, 1)), sizes, sizes
    return LandmarkSamples(evidence, *geometry, label=label, scene=np.zeros(count, dtype=np.int64))


@pytest.fixture
def mapped(monkeypatch):
    """`mapped(f)` puts f(scene, model) in the place of mapping; the list of models that it was called with."""

    def install(make):
        models = []

        def fake(scene, detector, model, classes, config):
            assert classes == CLASSES
            models.append(model)
            return make(scene, model)

        monkeypatch.setattr(existence, "landmark_samples", fake)
        return models

    return install


def by_scene(count: int = 150):
    return lambda scene, model: records(count, seed=int(scene.centers[0, 0]))


def test_every_round_maps_with_what_the_last_one_learned(mapped):
    models, done = mapped(by_scene()), []
    learned = learn_existence([scene(1), scene(2)], MODEL, CLASSES, on_frame=done.append)
    assert learned.fitted and learned.records == 300
    assert models[:2] == [MODEL, MODEL] and len(models) == 2 * ROUNDS
    assert models[2] is models[3] and models[2].existence != MODEL.existence
    assert done == [FRAMES * k for k in range(1, 2 * ROUNDS + 1)]
    assert learned.model.scores is MODEL.scores and learned.model.detection is MODEL.detection
    mean, covariance = learned.model.background_size
    assert mean == pytest.approx([-2.5] * 3, abs=0.15) and np.diag(covariance) == pytest.approx([0.16] * 3, abs=0.06)


def test_it_learns_that_false_ones_are_rarely_found(mapped):
    mapped(by_scene(400))
    model = learn_existence([scene(1), scene(2)], MODEL, CLASSES).model.existence
    often, seldom = model.rate_ratio(np.array([6.0, 1.0]), np.array([1.0, 6.0])) * model.weight_rate
    assert often > 1.5 and seldom < -1.5


def test_sequences_left_out_are_judged_by_the_others(mapped):
    mapped(by_scene(400))
    learned = learn_existence([scene(k) for k in range(4)], MODEL, CLASSES)
    calibration = learned.calibration
    assert calibration is not None and calibration.records == calibration.existence.count.sum() == 1600
    assert calibration.objects == calibration.label.count.sum() == pytest.approx(800, abs=80)
    assert calibration.existence.expected_error < 0.05 and calibration.label.expected_error < 0.1
    said = learned.summary()
    assert f"{calibration.existence.expected_error:.3f}" in said and f"{calibration.label.expected_error:.3f}" in said
    assert "1600 records" in said and f"{calibration.objects} of them objects" in said


def test_sequences_that_differ_show_when_left_out(mapped):
    """In every other sequence all is false: whoever learned from the rest is far too sure there."""

    def make(scene, model):
        number = int(scene.centers[0, 0])
        few = records(200, seed=number, objects=0.9 if number % 2 else 0.1)
        return replace(few, evidence=replace(few.evidence, hits=0.0 * few.evidence.hits, misses=np.ones(200)))

    mapped(make)
    learned = learn_existence([scene(k) for k in range(4)], MODEL, CLASSES)
    assert learned.calibration is not None and learned.calibration.existence.expected_error > 0.5


def test_two_detectors_in_one_room_are_one_scene(mapped):
    """Or the sequence left out would not be left out."""
    mapped(by_scene())
    assert learn_existence([scene(1), scene(1)], MODEL, CLASSES).calibration is None
    learned = learn_existence([scene(1), scene(1), scene(2)], MODEL, CLASSES)
    assert learned.calibration is not None
    alone = learn_existence([scene(1)], MODEL, CLASSES)
    assert alone.fitted and alone.calibration is None and "tried on no other sequence" in alone.summary()


def test_truths_that_do_not_know_all_are_left_out(mapped):
    looked_at = []

    def make(scene, model):
        looked_at.append(scene.complete)
        return records(100, 1)

    mapped(make)
    nothing = learn_existence([scene(1, complete=False)], MODEL, CLASSES)
    assert not looked_at and not nothing.fitted and nothing.records == 0 and nothing.model is MODEL
    assert "0 records" in nothing.summary() and "objects are all known" in nothing.summary()
    some = learn_existence([scene(1, complete=False), scene(2)], MODEL, CLASSES)
    assert looked_at == [True] * ROUNDS and some.records == 100


@pytest.mark.parametrize(
    ("count", "objects"), [(FEWEST - 1, 0.5), (200, 0.0), (200, 1.0)], ids=["few", "all false", "all objects"]
)
def test_too_few_landmarks_teach_nothing(mapped, count, objects):
    mapped(lambda scene, model: records(count, 1, objects))
    learned = learn_existence([scene(1)], MODEL, CLASSES)
    assert not learned.fitted and learned.calibration is None
    assert learned.model is MODEL and learned.records == count
    assert f"{count} records" in learned.summary() and "stay as they were" in learned.summary()


def test_weights_stay_as_they_were_when_the_second_round_finds_too_few(mapped):
    mapped(lambda scene, model: records(200, 1) if model is MODEL else None)
    learned = learn_existence([scene(1)], MODEL, CLASSES)
    assert not learned.fitted and learned.model is MODEL


def test_the_page_says_how_sure_to_be(mapped, make_samples):
    first = learn(make_samples(), "mine")
    mapped(by_scene(300))
    second = learn_existence([scene(1), scene(2)], first.model, CLASSES)
    page = render_page(replace(first, model=second.model), second)
    shown = section(page)
    assert "600 records" in shown and f"{second.model.existence.weight_rate:.3g}"[:4] in shown
    assert shown.count("<svg class=") == 2 and shown.count("<table>") == 4
    assert str(int(second.calibration.existence.count.max())) in shown
    ids = re.findall(r'\bid="([^"]*)"', page)
    assert len(ids) == len(set(ids)) and page == render_page(replace(first, model=second.model), second)


def test_the_page_without_a_second_stage(make_samples):
    first = learn(make_samples(), "mine")
    assert "not mapped" in section(render_page(first))
    shown = section(render_page(first, LearnedExistence(first.model, 12, fitted=False)))
    assert "12 records" in shown and "<svg class=" not in shown and "<table>" not in shown
    alone = section(render_page(first, LearnedExistence(first.model, 80, fitted=True)))
    assert "tried on no other" in alone and "<svg class=" not in alone and alone.count("<table>") == 2


def section(page: str) -> str:
    return page[page.index('<section id="existence">') :].split("</section>")[0]
