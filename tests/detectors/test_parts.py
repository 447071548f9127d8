"""Boxes of halves and of the wholes they imply."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thingmap.detectors.detections import Detections, Part
from thingmap.detectors.letterbox import Letterbox
from thingmap.detectors.parts import part_box, whole_box

BOX = np.array([10.0, 20.0, 50.0, 100.0])
HALVES = {
    Part.WHOLE: [10, 20, 50, 100],
    Part.TOP: [10, 20, 50, 60],
    Part.BOTTOM: [10, 60, 50, 100],
    Part.LEFT: [10, 20, 30, 100],
    Part.RIGHT: [30, 20, 50, 100],
}


@st.composite
def boxes_and_parts(draw) -> tuple[np.ndarray, np.ndarray]:
    """(N, 4) boxes with corners in order, and (N,) parts."""
    n = draw(st.integers(0, 6))
    start = draw(arrays(np.float64, (n, 2), elements=st.floats(-1e4, 1e4)))
    extent = draw(arrays(np.float64, (n, 2), elements=st.floats(0, 1e4)))
    return np.concatenate([start, start + extent], axis=1), draw(arrays(np.int8, n, elements=st.integers(0, 4)))


@pytest.mark.parametrize("part", list(Part))
def test_halves_by_hand(part: Part):
    assert part_box(BOX, part).tolist() == HALVES[part]
    assert whole_box(np.array(HALVES[part]), part).tolist() == BOX.tolist()


@given(boxes_and_parts())
def test_a_half_implies_its_whole(drawn: tuple[np.ndarray, np.ndarray]):
    xyxy, part = drawn
    there, back = whole_box(part_box(xyxy, part), part), part_box(whole_box(xyxy, part), part)
    assert there.shape == back.shape == xyxy.shape
    np.testing.assert_allclose(there, xyxy, rtol=0, atol=1e-10)
    np.testing.assert_allclose(back, xyxy, rtol=0, atol=1e-10)


@given(boxes_and_parts())
def test_halves_have_half_the_area_and_lie_inside(drawn: tuple[np.ndarray, np.ndarray]):
    xyxy, part = drawn
    half = part_box(xyxy, part)
    assert np.all(half[:, :2] >= xyxy[:, :2] - 1e-9) and np.all(half[:, 2:] <= xyxy[:, 2:] + 1e-9)
    area, of_half = (np.prod(x[:, 2:] - x[:, :2], axis=1) for x in (xyxy, half))
    np.testing.assert_allclose(of_half, np.where(part == Part.WHOLE, 1.0, 0.5) * area, rtol=1e-6, atol=1e-6)


def test_halving_goes_through_a_letterbox():
    letterbox = Letterbox.fit((640, 480), (416, 416), centred=True)
    xyxy, part = np.tile(BOX, (5, 1)), np.arange(5)
    np.testing.assert_allclose(
        letterbox.to_source(part_box(xyxy, part)), part_box(letterbox.to_source(xyxy), part), rtol=1e-12
    )


def test_parts_stay_with_their_boxes():
    xyxy = np.array([[-9, 0, 9, 9], [70, 0, 80, 9], [1, 1, 5, 5], [2, 2, 4, 4], [3, 3, 9, 60]], dtype=float)
    found = Detections(("a",), xyxy, np.full((5, 1), 0.5), np.arange(5))
    assert found.clip(64, 48).part.tolist() == [0, 2, 3, 4]
    assert found.select([3, 1]).part.tolist() == [3, 1]
    assert Detections.concatenate([found.select([4]), found.select([]), found.select([2])]).part.tolist() == [4, 2]
