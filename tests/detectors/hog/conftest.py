"""A scene of two things, and models whose templates are each made from one window of it."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.detectors.detections import Part
from thingmap.detectors.hog.channels import CELL, Channels
from thingmap.detectors.hog.config import PyramidConfig
from thingmap.detectors.hog.model import HogModel, HogTemplate
from thingmap.detectors.hog.pyramid import window_features
from thingmap.detectors.parts import part_box

BALL, CRATE = np.array([48.0, 32.0, 96.0, 80.0]), np.array([144.0, 40.0, 176.0, 104.0])  # on the grid of scale 1


@pytest.fixture(scope="session")
def scene() -> Frame:
    """A ball in the window (48, 32, 96, 80) and a crate in (144, 40, 176, 104), 0.8 m away, before a wall at 1.6 m."""
    rng = np.random.default_rng(5)
    color = cv2.GaussianBlur(rng.uniform(80, 176, (160, 224, 3)), (0, 0), 2.0)
    depth = np.full((160, 224), 1.6) + cv2.GaussianBlur(rng.normal(0.0, 0.05, (160, 224)), (0, 0), 4.0)
    cv2.circle(color, (72, 56), 21, (230, 60, 40), -1)
    cv2.rectangle(color, (147, 43), (172, 100), (40, 60, 220), -1)
    for y in range(50, 100, 14):
        cv2.line(color, (147, y), (172, y), (240, 240, 240), 3)
    rows, columns = np.mgrid[0:160, 0:224]
    depth[np.hypot(rows - 56, columns - 72) < 21] = 0.8
    depth[43:101, 147:173] = 0.8
    K = Intrinsics(224, 160, 220.0, 220.0, 111.5, 79.5)
    return Frame(0, "scene", 0.0, color.clip(0, 255).astype(np.uint8), depth.astype(np.float32), K)


@pytest.fixture(scope="session")
def make_template(scene: Frame) -> Callable[..., HogTemplate]:
    """A template that gives 1 in its own window: its features less their mean over the cells. Half of that is 1:1."""

    def make(class_id: int, window: np.ndarray, channels: Channels, part: Part = Part.WHOLE) -> HogTemplate:
        box = part_box(window, part)
        cells = round((box[3] - box[1]) / CELL), round((box[2] - box[0]) / CELL)
        features, scale = window_features(scene.color, scene.depth, scene.intrinsics.fx, box, cells, channels)
        assert scale == pytest.approx(1.0)
        weights = features - features.mean(axis=(0, 1))
        weights /= (weights**2).sum()
        bias = 1.0 - float((weights * features).sum())
        return HogTemplate(class_id, part, weights, 0.0, bias, (-12.0, 6.0), (0.0, 0.0, 1.0, 1.0))

    return make


@pytest.fixture(scope="session")
def make_model(make_template: Callable[..., HogTemplate]) -> Callable[..., HogModel]:
    """A model of both things."""

    def make(channels: Channels = Channels.RGBD, parts: tuple[Part, ...] = (Part.WHOLE,)) -> HogModel:
        windows = ((0, BALL), (1, CRATE))
        templates = tuple(make_template(*window, channels, part) for window in windows for part in parts)
        return HogModel(("ball", "crate"), channels, templates, PyramidConfig(max_scale=2.0), {})

    return make
