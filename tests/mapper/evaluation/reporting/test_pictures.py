import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.datasets.frame import BrokenFrame, FrameProblem
from thingmap.mapper.evaluation.reporting.pictures import LARGEST, SMALLEST, crop, take_pictures
from thingmap.mapper.evaluation.result import WorstCase

BOX = (100.0, 80.0, 139.0, 109.0)


def decode(jpeg: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def make_image(height: int = 240, width: int = 320, box=BOX) -> np.ndarray:
    """Red where the box is, grey elsewhere; the box has pixel centres at integers."""
    image = np.full((height, width, 3), 90, np.uint8)
    x1, y1, x2, y2 = (round(side) for side in box)
    image[y1 : y2 + 1, x1 : x2 + 1] = (230, 20, 20)
    return image


def test_the_box_lies_on_what_it_shows():
    edges = (99.5, 79.5, 139.5, 109.5)  # of the pixels 100..139, 80..109
    picture = crop(make_image(), edges, None)
    shown = decode(picture.jpeg)
    assert shown.shape[:2] == (picture.height, picture.width) and picture.found is None
    x1, y1, x2, y2 = (round(side) for side in picture.truth)
    assert x2 - x1 == 40 and y2 - y1 == 30
    assert shown[y1 + 3 : y2 - 3, x1 + 3 : x2 - 3, 0].min() > 180
    assert shown[y1 + 3 : y2 - 3, x1 - 8 : x1 - 3, 0].max() < 140


def test_large_crops_are_shrunk_with_their_boxes():
    picture = crop(make_image(960, 1280, (300, 200, 899, 699)), (299.5, 199.5, 899.5, 699.5), None)
    assert picture.width == LARGEST and picture.height == pytest.approx(LARGEST * 3 / 4, abs=1)
    x1, y1, x2, y2 = picture.truth
    assert (x2 - x1) / (y2 - y1) == pytest.approx(600 / 500, rel=0.01)
    shown = decode(picture.jpeg)
    assert shown[round((y1 + y2) / 2), round((x1 + x2) / 2), 0] > 180


def test_both_boxes_are_in_and_tiny_ones_keep_their_surroundings():
    picture = crop(make_image(), (10.0, 10.0, 20.0, 20.0), (40.0, 30.0, 50.0, 44.0))
    for box in (picture.truth, picture.found):
        assert 0 <= box[0] < box[2] <= picture.width and 0 <= box[1] < box[3] <= picture.height
    tiny = crop(make_image(), (100.0, 100.0, 102.0, 103.0), None)
    assert tiny.width == SMALLEST


def test_without_boxes_the_whole_frame_is_shown():
    picture = crop(make_image(), None, (0.0, float("nan"), 1.0, 1.0))
    assert (picture.width, picture.height, picture.truth, picture.found) == (320, 240, None, None)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(st.floats(-200, 500), st.floats(-200, 500), st.floats(0.1, 700), st.floats(0.1, 700)),
    st.sampled_from([(240, 320), (64, 400), (300, 90)]),
)
def test_any_box_gives_a_picture(values, shape):
    x, y, w, h = values
    picture = crop(np.zeros((*shape, 3), np.uint8), (x, y, x + w, y + h), None)
    assert decode(picture.jpeg).shape[:2] == (picture.height, picture.width)
    assert 1 <= picture.width <= LARGEST
    x1, _, x2, _ = picture.truth
    visible = min(x + w, shape[1]) - max(x, 0) > 1 and min(y + h, shape[0]) - max(y, 0) > 1
    assert not visible or (x2 > 0 and x1 < picture.width)


class Frames:
    """A sequence whose frame 2 is broken; it counts what is read."""

    def __init__(self) -> None:
        self.read: list[int] = []

    def __len__(self) -> int:
        return 4

    def __getitem__(self, index: int):
        self.read.append(index)
        if index == 2:
            raise BrokenFrame("frame-2", FrameProblem.UNREADABLE)
        return type("F", (), {"color": make_image()})


def test_each_frame_is_read_once_and_broken_ones_have_no_picture():
    frames = Frames()
    cases = [
        WorstCase("a", 3, BOX),
        WorstCase("b", 1, BOX),
        WorstCase("c", 3, None, BOX),
        WorstCase("broken", 2, BOX),
        WorstCase("beyond", 9, BOX),
        WorstCase("nowhere"),
    ]
    pictures = take_pictures(cases, frames)
    assert {case.text for case in pictures} == {"a", "b", "c"} and frames.read == [1, 2, 3]
    assert take_pictures(cases, None) == {}
