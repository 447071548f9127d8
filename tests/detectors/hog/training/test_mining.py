from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.object_views.backgrounds import Background
from thingmap.detectors.boxes import box_ious
from thingmap.detectors.detections import Part
from thingmap.detectors.hog.model import HogTemplate
from thingmap.detectors.hog.training.mining import FrameWindows
from thingmap.detectors.hog.training.negatives import Negatives, key, sample_rows, window_samples
from thingmap.detectors.hog.training.rounds import frame_pyramid
from thingmap.detectors.parts import part_box

CLASSES = ("disc", "cross")


def template(class_id: int, part: Part = Part.WHOLE, seed: int = 0) -> HogTemplate:
    cells = (4, 2 if part == Part.LEFT else 4, 82)
    weights = np.random.default_rng(seed).normal(0.0, 0.3, cells).astype(np.float32)
    return HogTemplate(class_id, part, weights, 0.1, 0.0, (-1.0, 0.0), (0.1, 0.1, 0.9, 0.9))


@pytest.fixture(scope="module")
def looking(make_frame_with, small) -> tuple[Background, FrameWindows, list[HogTemplate]]:
    frame = make_frame_with(7, "disc", "cross")
    templates = [template(0), template(1), template(0, Part.LEFT, 1)]
    return frame, FrameWindows(templates, frame, frame_pyramid(frame, small), CLASSES, 0.3), templates


def test_scores_are_those_of_the_samples(looking, small):
    frame, windows, templates = looking
    pyramid = frame_pyramid(frame, small)
    for one, found in zip(templates, windows.hard(-1.0), strict=True):
        assert len(found.score) > 5 and (np.diff(found.score) <= 0).all() and found.score[-1] > -1.0
        samples = window_samples(pyramid, found.place, *one.weights.shape[:2]).astype(np.float32)
        expected = samples @ np.append(one.weights.ravel(), np.float32(one.scale_weight)) + one.bias
        np.testing.assert_allclose(found.score, expected, atol=0.02)


@pytest.fixture(scope="module")
def unknowing(looking, small) -> FrameWindows:
    """The same frame, of whose objects nothing is known."""
    frame, _, templates = looking
    unknown = replace(frame, labels=(), xyxy=np.zeros((0, 4)), visibility=np.zeros(0))
    return FrameWindows(templates, unknown, frame_pyramid(frame, small), CLASSES, 0.3)


def test_true_objects_of_the_class_are_left_out_and_others_not(looking, unknowing):
    frame, windows, _ = looking
    for t in (0, 1):
        every, kept = unknowing.hard(-50.0)[t], windows.hard(-50.0)[t]
        shown = box_ious(unknowing.boxes(t, every), frame.xyxy[[t]])[:, 0] >= 0.3
        assert shown.any()
        np.testing.assert_array_equal(kept.place, every.place[~shown])
        assert (box_ious(windows.boxes(t, kept), frame.xyxy[[1 - t]]) >= 0.3).any()


def test_a_half_template_leaves_out_its_own_half_only(looking, unknowing):
    frame, windows, _ = looking
    every, kept = unknowing.hard(-50.0)[2], windows.hard(-50.0)[2]
    shown = box_ious(unknowing.boxes(2, every), part_box(frame.xyxy[[0]], Part.LEFT))[:, 0] >= 0.3
    assert shown.any()
    np.testing.assert_array_equal(kept.place, every.place[~shown])


def test_neighbours_one_cell_away_are_the_same_window(looking):
    _, windows, _ = looking
    place = windows.hard(-50.0)[0].place.astype(int)
    for level in np.unique(place[:, 0]):
        ij = place[place[:, 0] == level, 1:]
        distance = np.abs(ij[:, None] - ij[None]).max(axis=2) + 9 * np.eye(len(ij), dtype=int)
        assert distance.min() > 1


def test_random_windows_fit_and_differ(looking, small):
    frame, windows, templates = looking
    pyramid = frame_pyramid(frame, small)
    drawn = windows.random(40, np.random.default_rng(0))
    again = windows.random(40, np.random.default_rng(0))
    for one, found, same in zip(templates, drawn, again, strict=True):
        rows, columns, _ = one.weights.shape
        np.testing.assert_array_equal(found.place, same.place)
        assert 25 < len(found.place) == len(np.unique(found.place, axis=0)) <= 40
        assert len(np.unique(found.place[:, 0])) > 1
        for level, i, j in found.place:
            height, width, _ = pyramid.levels[level].features.shape
            assert i + rows <= height and j + columns <= width


def test_the_hardest_stay_in_their_order():
    place = np.arange(20, dtype=np.int32).reshape(5, 4)
    some = Negatives(place, np.zeros((5, 3), np.float16))
    kept = some.hardest(np.array([0.1, 0.9, 0.5, 0.9, 0.2]), 3)
    np.testing.assert_array_equal(kept.place, place[[1, 2, 3]])
    assert some.hardest(np.zeros(5), 9) is some


def test_every_place_has_a_key_of_its_own():
    place = np.array([[0, 0, 0, 1], [0, 0, 1, 0], [0, 1, 0, 0], [1, 0, 0, 0], [3, 12, 250, 333]], np.int32)
    assert len(np.unique(key(place))) == 5


def test_samples_end_with_the_scale():
    rows = sample_rows(np.ones((2, 4, 4, 3), np.float32), np.array([0.5, 2.0]))
    assert rows.shape == (2, 49) and rows.dtype == np.float16
    np.testing.assert_array_equal(rows[:, -1], [-1.0, 1.0])
