"""Frames and models in which there is little to find or to go by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame
from thingmap.detectors.detections import Detections, Part
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.detector import HogDetector
from thingmap.detectors.hog.score_vectors import LEAST

CLASSES = ("ball", "crate")
BALL, CRATE = np.array([48.0, 32.0, 96.0, 80.0]), np.array([144.0, 40.0, 176.0, 104.0])  # their windows


def with_depth(frame: Frame, depth: np.ndarray) -> Frame:
    return replace(frame, depth=depth.astype(np.float32))


def cut(frame: Frame, x: slice, y: slice) -> Frame:
    color, depth = frame.color[y, x].copy(), frame.depth[y, x].copy()
    K = replace(frame.intrinsics, width=color.shape[1], height=color.shape[0])
    return replace(frame, color=color, depth=depth, intrinsics=K)


def test_nothing_found(scene: Frame, make_model):
    found, maps = HogDetector(make_model(), confidence=1.0).detect_dense(scene)
    assert len(found) == 0 and found.scores.shape == (0, 2) and found.classes == CLASSES
    assert maps.probabilities.shape == (2, 160, 224)


@pytest.mark.parametrize("size", [(0, 0), (1, 1), (7, 9), (3, 60), (9, 9), (24, 30)])
def test_images_of_a_few_pixels(scene: Frame, make_model, size: tuple[int, int]):
    tiny = cut(scene, slice(60, 60 + size[1]), slice(40, 40 + size[0]))
    found, maps = HogDetector(make_model(), confidence=0.01).detect_dense(tiny)
    assert isinstance(found, Detections) and maps.probabilities.shape == (2, *size)
    assert (found.xyxy >= 0).all() and (found.xyxy <= np.array([*size[::-1], *size[::-1]])).all()


def test_boxes_of_things_that_reach_out_of_the_image_are_cut(scene: Frame, make_model):
    """Two cells of border let a window reach 16 px over the edge."""
    view = cut(scene, slice(64, 224), slice(0, 160))
    found = HogDetector(make_model(), confidence=0.05)(view)
    best = found.select((found.class_id == 0) & (found.xyxy[:, 0] == 0.0))
    assert len(best)
    np.testing.assert_allclose(best.xyxy[0], [0.0, 32.0, 32.0, 80.0], atol=8.0)
    # only the middle of the ball: larger than the image on all sides
    inside = cut(scene, slice(56, 88), slice(40, 72))
    for one in HogDetector(make_model(), confidence=0.0)(inside).xyxy:
        assert (one >= 0).all() and (one <= 32).all() and one[2] > one[0] and one[3] > one[1]


def test_holes_in_depth_cost_little(scene: Frame, make_model):
    depth = scene.depth.copy()
    depth[np.random.default_rng(0).uniform(size=depth.shape) < 0.2] = 0.0
    found = HogDetector(make_model())(with_depth(scene, depth))
    ball = found.select(found.class_id == 0)
    np.testing.assert_allclose(ball.xyxy[0], BALL, atol=8.0)
    assert ball.confidence[0] > 0.5


@pytest.mark.parametrize("channels", [Channels.RGBD, Channels.DEPTH])
def test_all_depth_missing(scene: Frame, make_model, channels: Channels):
    blind = with_depth(scene, np.zeros_like(scene.depth))
    found, maps = HogDetector(make_model(channels)).detect_dense(blind)
    assert np.isfinite(maps.probabilities).all() and (maps.probabilities > 0).all()
    assert len(found) == 0 or found.confidence[0] < 0.99


def test_a_model_of_colour_does_not_ask_for_depth(scene: Frame, make_model, assert_same):
    detector, blind = HogDetector(make_model(Channels.RGB)), with_depth(scene, np.zeros((0, 0)))
    assert_same(detector(blind), detector(scene))
    maps = detector.detect_dense(blind)[1].probabilities
    assert maps[0, 56, 72] > 0.9


def test_a_model_of_depth_asks_for_it(scene: Frame, make_model):
    for channels in (Channels.RGBD, Channels.DEPTH):
        with pytest.raises(UserError, match=r"frame scene: the HOG model looks at depth .*--channels rgb"):
            HogDetector(make_model(channels))(with_depth(scene, np.zeros((0, 0))))


@pytest.mark.parametrize(
    ("options", "message"),
    [({"confidence": 1.5}, "confidence"), ({"nms_iou": -0.1}, "nms_iou"), ({"max_detections": 0}, "max_detections")],
)
def test_options_out_of_range(make_model, options: dict, message: str):
    with pytest.raises(UserError, match=f"{message} must be"):
        HogDetector(make_model(), **options)


def test_a_model_of_halves_only(scene: Frame, make_model):
    halves = make_model(parts=(Part.TOP,))
    found, maps = HogDetector(halves).detect_dense(scene)
    assert len(found) and (found.part == Part.TOP).all() and maps.probabilities.max() == pytest.approx(LEAST)
    assert len(HogDetector(halves, parts=False)(scene)) == 0
