"""Windows that the second stage has judged, and the detector that reports them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import Frame
from thingmap.detectors.detections import Part
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.detector import HogDetector
from thingmap.detectors.hog.model import HogModel, load_model
from thingmap.detectors.hog.score_vectors import LEAST
from thingmap.detectors.hog.second_stage.judged import PROPOSED, JudgedWindows
from thingmap.detectors.hog.second_stage.network import WindowNetwork
from thingmap.detectors.hog.second_stage.window_views import view_size
from thingmap.detectors.model_file import read_document, write_document

INPUTS = view_size(Channels.RGBD.count, 2)
CLASS = INPUTS - 2  # where the template's class is told
WINDOWS = np.array([[0, 0, 40, 40], [2, 0, 42, 40], [100, 0, 140, 40], [200, 0, 200, 40]], dtype=np.float64)
JUDGED = JudgedWindows(WINDOWS, np.array([[0.6, 0.3], [0.5, 0.45], [0.05, 0.2], [0.9, 0.9]]))


def says(swap: bool = False, offsets: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)) -> WindowNetwork:
    """A network that takes each window for the class of its template, or for the other one: odds of e^3 to 1."""
    weights = np.zeros((INPUTS, 7), np.float32)
    for k in range(2):
        weights[CLASS + k, 1 - k if swap else k] = 6.0
    bias = np.array([-3.0, -3.0, 0.0, *offsets], np.float32)
    return WindowNetwork(np.zeros(INPUTS, np.float32), np.ones(INPUTS, np.float32), (weights,), (bias,))


def test_of_each_class_the_surest_of_those_at_one_place():
    found = JUDGED.of_each_class(0.1, 0.4, 10)
    assert found.class_id.tolist() == [0, 1, 1] and (found.part == Part.WHOLE).all()
    np.testing.assert_allclose(found.probability, [0.6, 0.45, 0.2])
    np.testing.assert_array_equal(found.xyxy, WINDOWS[[0, 1, 2]])


def test_merged_there_is_one_box_at_a_place_with_all_that_is_said_of_it():
    found = JUDGED.merged(0.1, 0.4, 10)
    np.testing.assert_array_equal(found.xyxy, WINDOWS[[0, 2]])
    np.testing.assert_allclose(found.probability, [[0.6, 0.3], [0.05, 0.2]])
    assert len(JUDGED.merged(0.3, 0.4, 10).xyxy) == 1 and len(JUDGED.merged(0.1, 0.4, 1).xyxy) == 1
    assert len(JudgedWindows(np.zeros((0, 4)), np.zeros((0, 2))).merged(0.1, 0.4, 10).xyxy) == 0


def test_scores_are_never_nothing():
    sure = JudgedWindows(WINDOWS[:1], np.array([[1.0, 0.0]]))
    np.testing.assert_array_equal(sure.scores, [[1.0, LEAST]])


@pytest.fixture(scope="module")
def model(make_model) -> HogModel:
    return make_model(parts=tuple(Part))


def test_the_second_stage_decides_of_wholes_and_not_of_halves(scene: Frame, model: HogModel):
    plain, swapped = HogDetector(model), HogDetector(replace(model, second_stage=says(swap=True)))
    before, after = plain(scene), swapped(scene)
    halves = [found.select(found.part != Part.WHOLE) for found in (before, after)]
    np.testing.assert_array_equal(halves[0].xyxy, halves[1].xyxy)
    np.testing.assert_array_equal(halves[0].scores, halves[1].scores)
    best = before.select(before.part == Part.WHOLE).select(np.array([0]))
    row = np.flatnonzero((after.part == Part.WHOLE) & (np.abs(after.xyxy - best.xyxy[0]).max(axis=1) < 1e-6))
    assert len(row) == 1 and after.class_id[row[0]] == 1 - best.class_id[0]
    z = np.exp([3.0, -3.0, 0.0])
    np.testing.assert_allclose(np.sort(after.scores[row[0]]), np.sort(z / z.sum())[[0, 2]], rtol=1e-3)


def test_boxes_are_the_corrected_ones_and_cut_to_the_image(scene: Frame, model: HogModel):
    moved = replace(model, second_stage=says(offsets=(0.25, 0.0, 0.0, np.log(0.5))))
    same = replace(model, second_stage=says())
    boxes = [HogDetector(one, parts=False, nms_iou=0.99)(scene).xyxy for one in (same, moved)]
    ball = np.array([48.0, 32.0, 96.0, 80.0])
    assert (np.abs(boxes[0] - ball).max(axis=1) < 1e-6).any()
    assert (np.abs(boxes[1] - (ball + np.array([12.0, 12.0, 12.0, -12.0]))).max(axis=1) < 1e-4).any()
    assert (boxes[1] >= 0.0).all() and (boxes[1] <= np.array([224.0, 160.0, 224.0, 160.0])).all()


def test_without_merging_every_class_has_its_own_boxes(scene: Frame, model: HogModel):
    found = HogDetector(replace(model, second_stage=says()), merge=False, parts=False)(scene)
    assert set(found.class_id) == {0, 1}
    assert (np.isfinite(found.scores).sum(axis=1) == 1).all()


def test_maps_say_no_more_than_the_boxes(scene: Frame, model: HogModel):
    detector = HogDetector(replace(model, second_stage=says(swap=True)))
    found, maps = detector.detect_dense(scene)
    assert len(found) == len(detector(scene))
    ball = maps.probabilities[:, 56, 72]
    assert ball[1] > 0.9
    of_each_class = HogDetector(detector.model, merge=False, parts=False)(scene)
    inside = np.zeros(maps.background.shape, bool)
    for x0, y0, x1, y1 in np.rint(of_each_class.xyxy).astype(int):
        inside[max(y0 - 1, 0) : y1 + 1, max(x0 - 1, 0) : x1 + 1] = True
    assert maps.probabilities[:, ~inside].max() <= PROPOSED + 1e-7


def test_models_whose_second_stage_does_not_fit(model: HogModel, make_model):
    with pytest.raises(ValueError, match="second stage is for"):
        replace(model, classes=("ball", "crate", "cup"), second_stage=says())
    with pytest.raises(ValueError, match="looks at depth"):
        replace(make_model(Channels.RGB), second_stage=says())


def test_there_and_back(model: HogModel, tmp_path):
    full = replace(model, second_stage=says())
    full.save(tmp_path / "a.npz")
    back = load_model(tmp_path / "a.npz")
    assert back.second_stage is not None and full.second_stage is not None
    np.testing.assert_array_equal(back.second_stage.weights[0], full.second_stage.weights[0])
    back.save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    document, arrays = read_document(tmp_path / "a.npz", "thingmap-hog/1", "a HOG model", "")
    arrays.pop("second_centre")
    write_document(tmp_path / "c.npz", document, arrays)
    with pytest.raises(InputError, match="second_centre"):
        load_model(tmp_path / "c.npz")
