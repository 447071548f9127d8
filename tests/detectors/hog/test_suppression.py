"""Which boxes give way to which."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thingmap.detectors.hog.suppression import overlap, suppress
from thingmap.detectors.onnx.suppression import suppress as suppress_across_classes

ONE = np.array([[0.0, 0.0, 10.0, 10.0]])


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        ((0, 0, 10, 10), 1.0),
        ((5, 0, 15, 10), 50 / 150),
        ((0, 0, 5, 5), 0.25),
        ((10, 0, 20, 10), 0.0),
        ((20, 20, 30, 30), 0.0),
        ((3, 3, 3, 8), 0.0),
    ],
)
def test_intersection_over_union(other: tuple[float, ...], expected: float):
    assert overlap(ONE[0], np.array(other, dtype=np.float64)) == pytest.approx(expected)
    assert overlap(np.array(other, dtype=np.float64), ONE[0]) == pytest.approx(expected)


def test_two_boxes_without_area_at_one_place():
    assert overlap(np.full(4, 3.0), np.full(4, 3.0)) == 0.0


def test_the_better_box_of_a_group_stays_and_other_groups_are_left_alone():
    boxes = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [1, 0, 11, 10], [30, 0, 40, 10]], dtype=np.float64)
    assert suppress(boxes, np.array([4, 4, 7, 4]), 0.5, 100).tolist() == [0, 2, 3]
    assert suppress(boxes, np.array([4, 4, 4, 4]), 0.5, 100).tolist() == [0, 3]
    assert suppress(boxes, np.array([4, 4, 4, 4]), 9 / 11, 100).tolist() == [0, 1, 3]  # 9 / 11 exactly: not above


def test_a_box_that_gave_way_suppresses_nothing():
    boxes = np.array([[0, 0, 10, 10], [4, 0, 14, 10], [8, 0, 18, 10]], dtype=np.float64)
    assert suppress(boxes, np.zeros(3, int), 0.4, 9).tolist() == [0, 2]


def test_no_more_than_so_many_of_each_group():
    boxes = np.array([[x, x, x + 10, x + 10] for x in np.arange(6.0) * 20])
    assert suppress(boxes, np.array([0, 1, 0, 0, 1, 0]), 0.5, 2).tolist() == [0, 1, 2, 4]


def test_nothing():
    assert suppress(np.zeros((0, 4)), np.zeros(0, int), 0.5, 10).tolist() == []


@given(
    arrays(np.float64, (12, 4), elements=st.integers(0, 8)),
    arrays(np.int64, 12, elements=st.integers(0, 2)),
    st.sampled_from([0.0, 0.2, 0.5, 1.0]),
    st.integers(1, 12),
)
def test_each_group_as_if_it_were_alone(corners: np.ndarray, group: np.ndarray, iou: float, most: int):
    boxes = np.hstack([corners[:, :2], corners[:, :2] + corners[:, 2:]])
    expected = np.zeros(len(boxes), dtype=bool)
    for g in range(3):
        rows = np.flatnonzero(group == g)
        order = -np.arange(len(rows), dtype=np.float64)  # the first is the best
        expected[rows[suppress_across_classes(boxes[rows], order, iou, most)]] = True
    assert suppress(boxes, group, iou, most).tolist() == np.flatnonzero(expected).tolist()
