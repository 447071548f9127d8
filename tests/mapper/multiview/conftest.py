"""Square cards that face a sliding camera, before a wall: every pixel and every mask is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.detectors.detections import Detections
from thingmap.mapper.config import KeyframeConfig, MapperConfig, MultiViewConfig, OdometryConfig, OdometrySource
from thingmap.mapper.multiview.track_mapper import TrackMapper

CAMERA = Intrinsics(160, 120, 130.0, 130.0, 79.5, 59.5)
CLASSES = ("cup", "bowl")
WALL = 2.0  # m
EVERY_FRAME = MapperConfig(odometry=OdometryConfig(source=OdometrySource.POSES), keyframes=KeyframeConfig(max_gap=1))


class Cards:
    """Cards with centres (3,) and half side lengths, metres, world; cameras look along z from (x, 0, 0)."""

    def __init__(self, *cards: tuple[Sequence[float], float]) -> None:
        self.cards = [(np.array(centre, dtype=float), half) for centre, half in cards]

    @staticmethod
    def pose(x: float) -> np.ndarray:
        T = np.eye(4)
        T[0, 3] = x
        return T

    def look(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """(H, W) depth and (H, W) number of the card in every pixel, -1 for the wall."""
        v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
        depth, owner = np.full(u.shape, WALL), np.full(u.shape, -1)
        for number, (centre, half) in enumerate(self.cards):
            z = centre[2]
            across = (u - CAMERA.cx) / CAMERA.fx * z + x - centre[0]
            down = (v - CAMERA.cy) / CAMERA.fy * z - centre[1]
            shown = (np.abs(across) <= half) & (np.abs(down) <= half) & (z < depth)
            depth[shown], owner[shown] = z, number
        return depth.astype(np.float32), owner

    def frame(self, index: int, x: float) -> Frame:
        depth, _ = self.look(x)
        color = np.full((CAMERA.height, CAMERA.width, 3), 128, np.uint8)
        return Frame(index, f"frame-{index:06d}", float(index), color, depth, CAMERA, self.pose(x))

    def detect(self, x: float, scores: dict[int, Sequence[float]], masks: bool = True) -> Detections:
        """Of the cards that `scores` has and that show, in that order."""
        owner = self.look(x)[1]
        shown = [number for number in scores if np.any(owner == number)]
        if not shown:
            return Detections.empty(CLASSES)
        boxes = []
        for number in shown:
            v, u = np.nonzero(owner == number)
            boxes.append([u.min(), v.min(), u.max() + 1, v.max() + 1])
        mask = np.array([owner == number for number in shown]) if masks else None
        return Detections(CLASSES, boxes, np.array([scores[number] for number in shown]), mask=mask)

    def map(self, views: Sequence[tuple[float, dict[int, Sequence[float]]]], masks: bool = True, **numbers: object):
        """A `TrackMapper` that has seen these views: the camera's x, and the scores of what is detected."""
        config = replace(EVERY_FRAME, multiview=replace(MultiViewConfig(), **numbers))  # type: ignore[arg-type]
        mapper = TrackMapper(None, config, source="cards")
        for index, (x, scores) in enumerate(views):
            mapper.process_frame(self.frame(index, x), self.detect(x, scores, masks))
        return mapper


class Tools:
    """What the tests share; a class, so that it needs no import."""

    camera, classes, config = CAMERA, CLASSES, EVERY_FRAME
    Cards = Cards


@pytest.fixture(scope="session")
def tools() -> type[Tools]:
    """`Cards` and its camera."""
    return Tools
