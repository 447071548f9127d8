"""Crops: which views they are of, and what they show."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.mapper.estimation.view_log import Verdict
from thingmap.mapper.map.boxes import box_corners
from thingmap.mapper.map.explanation import ViewExplanation
from thingmap.mapper.view.page.crops import EACH, HIGH, MOST, choose, cut, per_thing

CAMERA = Intrinsics(160, 120, 150.0, 150.0, 79.5, 59.5)
GREEN = np.array([0, 255, 0])


def view(stamp: float, ratio: float) -> ViewExplanation:
    verdict = Verdict.SUPPORTED if ratio > 0 else Verdict.MISSED
    return ViewExplanation(0, stamp, "f", {"whole": 1.0}, None, None, None, ratio, 1.0, verdict, "")


def a_frame() -> Frame:
    """Black, with a red square of 40 pixels in the middle."""
    color = np.zeros((120, 160, 3), dtype=np.uint8)
    color[40:80, 60:100, 0] = 200
    return Frame(0, "f", 0.0, color, np.ones((120, 160), dtype=np.float32), CAMERA)


def box_at(x: float, z: float, size: float = 0.26) -> np.ndarray:
    return box_corners(np.array([x, 0.0, z]), np.full(3, size), 0.0, np.eye(3))


def test_the_strongest_views_are_chosen_spread_in_time_and_on_their_own_side() -> None:
    views = [view(0.0, 5.0), view(0.1, 4.9), view(5.0, 2.0), view(10.0, 1.0), view(3.0, -3.0), view(4.0, 0.0)]
    assert [v.stamp for v in choose(views, True, 3)] == [0.0, 5.0, 10.0]
    assert [v.stamp for v in choose(views, False, 3)] == [3.0]
    assert [v.stamp for v in choose(views[:2], True, 3)] == [0.0, 0.1]  # nothing else is there
    assert choose([], True, 3) == []


def test_many_things_get_fewer_crops_each() -> None:
    assert per_thing(0) == per_thing(1) == EACH
    assert per_thing(10_000) == 1
    assert all(2 * count * per_thing(count) <= MOST for count in (10, 100, 200, 300))


def test_a_crop_shows_the_thing_in_the_middle_with_its_box() -> None:
    crop = cut(a_frame(), np.eye(4), box_at(0.0, 1.0), GREEN)
    assert crop is not None and max(crop.width, crop.height) == HIGH
    image = cv2.imdecode(np.frombuffer(crop.jpeg, dtype=np.uint8), cv2.IMREAD_COLOR)[..., ::-1].astype(int)
    assert image.shape == (crop.height, crop.width, 3)
    middle = image[crop.height // 2 - 10 : crop.height // 2 + 10, crop.width // 2 - 10 : crop.width // 2 + 10]
    assert np.median(middle[..., 0]) == pytest.approx(200, abs=12)
    assert image[2, 2].max() < 40  # the ground around it
    assert np.sum(image[..., 1] > 150) > 100  # green lines


def test_what_is_beside_or_behind_the_camera_has_no_crop() -> None:
    assert cut(a_frame(), np.eye(4), box_at(5.0, 1.0), GREEN) is None
    assert cut(a_frame(), np.eye(4), box_at(0.0, -1.0), GREEN) is None


def test_a_box_around_the_camera_is_cut_off_and_a_far_one_is_shown_with_its_surroundings() -> None:
    around = cut(a_frame(), np.eye(4), box_at(0.0, 0.1), GREEN)
    assert around is not None and (around.width, around.height) == (HIGH, round(HIGH * 0.75))
    far = cut(a_frame(), np.eye(4), box_at(0.0, 8.0), GREEN)
    assert far is not None and (far.width, far.height) == pytest.approx((HIGH, HIGH), abs=6)
    image = cv2.imdecode(np.frombuffer(far.jpeg, dtype=np.uint8), cv2.IMREAD_COLOR)[..., ::-1].astype(int)
    assert np.sum(image[..., 0] > 150) < 0.5 * image.shape[0] * image.shape[1]  # not only the square
