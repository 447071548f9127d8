"""What the detector finds, with templates made from one window each: they must find it again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import Frame
from thingmap.detectors.detections import Part
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.detector import HogDetector
from thingmap.detectors.hog.maps import MapConfig
from thingmap.detectors.hog.score_vectors import LEAST
from thingmap.detectors.parts import part_box

CLASSES = ("ball", "crate")
BALL, CRATE = np.array([48.0, 32.0, 96.0, 80.0]), np.array([144.0, 40.0, 176.0, 104.0])  # their windows


@pytest.mark.parametrize("channels", list(Channels))
def test_a_template_finds_its_own_window(scene: Frame, make_model, channels: Channels):
    found = HogDetector(make_model(channels), confidence=0.5)(scene)
    assert len(found) >= 2 and found.classes == CLASSES
    for class_id, window in ((0, BALL), (1, CRATE)):
        best = found.select(found.class_id == class_id)
        np.testing.assert_allclose(best.xyxy[0], window, atol=1e-6)
        assert best.confidence[0] == pytest.approx(1 / (1 + np.exp(-6.0)), abs=1e-4)


def test_halves_find_their_own_half_and_do_not_suppress_each_other(scene: Frame, make_model):
    found = HogDetector(make_model(parts=tuple(Part)), confidence=0.9)(scene)
    for class_id, window in ((0, BALL), (1, CRATE)):
        for part in Part:
            best = found.select((found.class_id == class_id) & (found.part == part))
            np.testing.assert_allclose(best.xyxy[0], part_box(window, part), atol=1e-6)
    whole_only = HogDetector(make_model(parts=tuple(Part)), confidence=0.9, parts=False)(scene)
    assert len(whole_only) and (whole_only.part == Part.WHOLE).all()
    np.testing.assert_array_equal(whole_only.scores, found.select(found.part == Part.WHOLE).scores)


def test_the_box_is_the_objects_and_not_the_windows(scene: Frame, make_model, make_template):
    tight = replace(make_template(0, BALL, Channels.RGB), box=(0.25, 0.0, 0.75, 0.5))
    found = HogDetector(replace(make_model(Channels.RGB), templates=(tight,)))(scene)
    np.testing.assert_allclose(found.xyxy[0], [60.0, 32.0, 84.0, 56.0], atol=1e-6)
    assert np.isnan(found.scores[:, 1]).all()  # there is no crate template to ask


def test_every_box_has_the_scores_of_all_classes(scene: Frame, make_model):
    found = HogDetector(make_model())(scene)
    assert (found.scores >= LEAST).all() and (found.confidence >= 0.1).all()
    assert (np.diff(found.confidence) <= 0).all()
    best = found.select(found.class_id == 0)
    assert best.scores[0, 0] > 0.99 and best.scores[0, 1] < 0.5


def test_two_classes_at_one_place_are_one_detection(scene: Frame, make_model, make_template):
    ball, lesser = make_template(0, BALL, Channels.RGBD), make_template(1, BALL, Channels.RGBD)
    lesser = replace(lesser, bias=lesser.bias - 0.1)
    both = replace(make_model(), templates=(lesser, ball))
    found = HogDetector(both, confidence=0.5)(scene)
    assert found.class_id[0] == 0
    assert found.scores[0] == pytest.approx([1 / (1 + np.exp(-6)), 1 / (1 + np.exp(-4.8))], abs=1e-4)
    for i in range(len(found)):
        apart = [abs(found.xyxy[i] - found.xyxy[j]).max() for j in range(len(found)) if j != i]
        assert min(apart, default=99) > 8.0


def test_without_merging_every_class_has_its_own_boxes(scene: Frame, make_model, make_template):
    ball, lesser = make_template(0, BALL, Channels.RGBD), make_template(1, BALL, Channels.RGBD)
    lesser = replace(lesser, bias=lesser.bias - 0.1)
    both = replace(make_model(), templates=(lesser, ball))
    apart = HogDetector(both, confidence=0.5, merge=False)(scene)
    np.testing.assert_allclose(apart.xyxy[:2], [BALL, BALL], atol=1e-6)
    assert apart.class_id[:2].tolist() == [0, 1] and (np.isnan(apart.scores).sum(axis=1) == 1).all()
    assert apart.confidence[:2] == pytest.approx([1 / (1 + np.exp(-6)), 1 / (1 + np.exp(-4.8))], abs=1e-4)


def test_the_same_frame_gives_the_same_detections_and_maps(scene: Frame, make_model, assert_same):
    detector = HogDetector(make_model(parts=tuple(Part)))
    first, again = detector(scene), detector(scene)
    dense, maps = detector.detect_dense(scene)
    assert_same(first, again)
    assert_same(first, dense)
    _, once_more = detector.detect_dense(scene)
    np.testing.assert_array_equal(maps.probabilities, once_more.probabilities)


def test_maps_show_where_the_things_are(scene: Frame, make_model):
    _, maps = HogDetector(make_model()).detect_dense(scene)
    ball, crate = maps.probabilities
    assert maps.classes == CLASSES and ball.shape == scene.depth.shape
    assert ball[56, 72] > 0.95 and crate[72, 160] > 0.95 and crate[56, 72] < 0.3
    assert maps.background[56, 72] < 0.01 and maps.background[150, 20] > 0.05
    # The box of the ball covers the wall beside it too, but by depth only the ball is filled.
    assert ball[44, 60] > 0.8 and ball[34, 50] == pytest.approx(LEAST, abs=1e-5)
    blunt = HogDetector(make_model(), maps=MapConfig(gamma=0.0)).detect_dense(scene)[1].probabilities[0]
    assert blunt[34, 50] > 0.95


def test_a_model_and_its_file_are_the_same(scene: Frame, make_model, tmp_path: Path):
    make_model().save(tmp_path / "m.npz")
    by_path = HogDetector(tmp_path / "m.npz")
    assert by_path.classes == CLASSES
    a, b = by_path(scene), HogDetector(make_model())(scene)
    for class_id in range(2):  # both things score 1 exactly, so that rounding decides on their order
        one, other = (found.select(found.class_id == class_id) for found in (a, b))
        np.testing.assert_allclose(one.xyxy[0], other.xyxy[0])
        np.testing.assert_allclose(one.scores[0], other.scores[0], atol=1e-3)
    with pytest.raises(InputError, match="no such file"):
        HogDetector(str(tmp_path / "n.npz"))


def test_no_more_than_so_many_of_each_part(scene: Frame, make_model):
    full = HogDetector(make_model(parts=tuple(Part)), confidence=0.01)(scene)
    few = HogDetector(make_model(parts=tuple(Part)), confidence=0.01, max_detections=2)(scene)
    assert (np.bincount(full.part) > 2).all()
    assert np.bincount(few.part).tolist() == [2] * 5
