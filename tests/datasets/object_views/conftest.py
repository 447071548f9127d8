"""A simple object and a simple room, exactly known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from thingmap.datasets.object_views.backgrounds import Background
from thingmap.datasets.object_views.object_view import ObjectView

FOCAL = 525.0


@pytest.fixture
def view() -> ObjectView:
    """A red upright board, 40 x 60 pixels, 1 m away, before a grey wall."""
    color = np.full((120, 100, 3), 128, np.uint8)
    depth = np.full((120, 100), 2.0, np.float32)
    mask = np.zeros((120, 100), bool)
    mask[30:90, 30:70] = True
    color[mask], depth[mask] = (200, 10, 10), 1.0
    return ObjectView("board", "board 1", "a view", color, depth, mask, np.array([30.0, 30.0, 70.0, 90.0]), FOCAL)


@pytest.fixture
def room() -> Callable[..., Background]:
    """A level floor below the camera, or only a wall before it; blue."""

    def make(floor: float | None = 0.5, wall: float = 3.0) -> Background:
        row = np.arange(480, dtype=np.float32)[:, None] - 239.5
        depth = np.full((480, 640), wall, np.float32)
        if floor is not None:
            on_floor = floor * FOCAL / np.maximum(row, 1e-3)
            depth = np.where((row > 0) & (on_floor < wall), on_floor, wall) * np.ones((1, 640), np.float32)
        color = np.full((480, 640, 3), (20, 20, 180), np.uint8)
        return Background("room", color, depth.astype(np.float32), FOCAL, (), np.zeros((0, 4)), np.zeros(0))

    return make
