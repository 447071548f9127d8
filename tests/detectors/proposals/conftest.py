"""A table with things on it, as a depth image made by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from thingmap.datasets.frame import Frame, Intrinsics

CAMERA = Intrinsics(320, 240, 260.0, 260.0, 159.5, 119.5)
Box = tuple[float, float, float, float, float]
"""x and y of the middle on the table, metres, then width, depth and height."""


def table_depth(boxes: list[Box], pitch: float = 0.6, height: float = 0.5, wall: float | None = 1.2) -> np.ndarray:
    """(240, 320) float32 metres of a table, upright boxes on it, and a wall behind.

    Args:
        boxes: what stands on the table, whose origin is below the camera; y is forward.
        pitch: radians that the camera looks down.
        height: metres of the camera above the table.
        wall: metres from the camera to a wall; None for none.
    """
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)
    c, s = np.cos(pitch), np.sin(pitch)
    # rows: x to the right, y forward, z up, in camera axes
    rays = rays @ np.array([[1.0, 0.0, 0.0], [0.0, -s, c], [0.0, -c, -s]]).T
    origin = np.array([0.0, 0.0, height])
    with np.errstate(divide="ignore", invalid="ignore"):
        best = np.where(rays[..., 2] < 0, -height / rays[..., 2], np.inf)
        if wall is not None:
            best = np.fmin(best, np.where(rays[..., 1] > 0, wall / rays[..., 1], np.inf))
        for x, y, width, depth, top in boxes:
            low = np.array([x - width / 2, y - depth / 2, 0.0])
            high = np.array([x + width / 2, y + depth / 2, top])
            near, far = (low - origin) / rays, (high - origin) / rays
            first, last = np.fmin(near, far).max(axis=-1), np.fmax(near, far).min(axis=-1)
            best = np.where((first <= last) & (first > 0), np.fmin(best, first), best)
    return np.where(np.isfinite(best), best, 0.0).astype(np.float32)


def up_of(pitch: float) -> np.ndarray:
    """(3,) up in camera axes."""
    return np.array([0.0, -np.cos(pitch), -np.sin(pitch)])


@pytest.fixture
def make_table() -> Callable[..., Frame]:
    """A frame of `table_depth`."""

    def make(boxes: list[Box], specific_force: np.ndarray | None = None, **kwargs) -> Frame:
        color = np.zeros((CAMERA.height, CAMERA.width, 3), dtype=np.uint8)
        return Frame(0, "table", 0.0, color, table_depth(boxes, **kwargs), CAMERA, specific_force=specific_force)

    return make
