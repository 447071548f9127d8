"""What the second stage sees of a window."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.frame import Frame
from thingmap.detectors.hog.candidates import Candidates
from thingmap.detectors.hog.channels import CELL, Channels
from thingmap.detectors.hog.config import PyramidConfig
from thingmap.detectors.hog.pyramid import Pyramid, build_pyramid
from thingmap.detectors.hog.second_stage.window_views import (
    CELLS,
    DISTANCE,
    FAR_APART,
    PIXELS,
    ROOM,
    view_size,
    window_views,
)

CHANNELS = Channels.RGBD.count


def windows(*boxes: tuple[float, float, float, float], class_id: int = 1, probability: float = 0.25) -> Candidates:
    n = len(boxes)
    xyxy = np.array(boxes, dtype=np.float64).reshape(-1, 4)
    return Candidates(np.full(n, class_id), np.zeros(n, np.int8), xyxy, np.full(n, probability))


def without_room(box: np.ndarray) -> tuple[float, float, float, float]:
    """The window that, with its room, is a box."""
    centre, half = 0.5 * (box[:2] + box[2:]), 0.5 * (box[2:] - box[:2]) / ROOM
    x0, y0, x1, y1 = np.concatenate([centre - half, centre + half])
    return x0, y0, x1, y1


@pytest.fixture(scope="module")
def pyramid(scene: Frame) -> Pyramid:
    return build_pyramid(scene.color, scene.depth, 220.0, Channels.RGBD, PyramidConfig(max_scale=2.0))


def parts_of(views: np.ndarray, classes: int = 2) -> list[np.ndarray]:
    """Cells, relative depth, what is read, scalars, class."""
    grid = PIXELS * PIXELS
    ends = np.cumsum([CELLS * CELLS * CHANNELS, grid, grid, 5])
    assert views.shape[1] == view_size(CHANNELS, classes) == ends[-1] + classes
    return np.split(views, ends, axis=1)


def test_a_window_on_cells_has_their_features(scene: Frame, pyramid: Pyramid):
    for level in pyramid.levels[::3]:
        side = CELL / level.scale
        box = np.array([side, 0.0, side * (1 + CELLS), side * CELLS])  # columns 1 to CELLS, rows 0 to CELLS - 1
        cells = parts_of(window_views(pyramid, scene.depth, 220.0, windows(without_room(box)), 2))[0]
        b = level.border
        expected = level.features[b : b + CELLS, b + 1 : b + 1 + CELLS]
        np.testing.assert_allclose(cells.reshape(expected.shape), expected, atol=1e-5)


def test_a_wall_is_flat_and_as_large_as_it_is(scene: Frame, pyramid: Pyramid):
    depth = np.full_like(scene.depth, 1.1)
    _, relative, is_read, scalars, which = parts_of(
        window_views(pyramid, depth, 220.0, windows((60.0, 40.0, 100.0, 60.0)), 2)
    )
    np.testing.assert_allclose(relative, 0.0, atol=1e-6)
    assert is_read.all()
    expected = [np.log(40.0 * 1.1 / 220.0), np.log(20.0 * 1.1 / 220.0), 1.1, 1.0, np.log(0.25 / 0.75)]
    np.testing.assert_allclose(scalars[0], expected, rtol=1e-5)
    np.testing.assert_array_equal(which[0], [0.0, 1.0])


def test_depth_is_in_sizes_of_the_window(scene: Frame, pyramid: Pyramid):
    depth = np.full_like(scene.depth, 1.0)
    depth[:, 84:] = 1.05
    depth[:40] = 9.0  # the upper edge of the room about the window
    relative = parts_of(window_views(pyramid, depth, 220.0, windows((60.0, 40.0, 100.0, 80.0)), 2))[1]
    grid = relative.reshape(PIXELS, PIXELS)
    size = 40.0 / 220.0
    assert grid[7, 7] == pytest.approx(0.0) and grid[7, -1] == pytest.approx(0.05 / size, rel=1e-4)
    assert (grid[0] == FAR_APART).all()


@pytest.mark.parametrize("nothing", [0.0, np.nan, np.inf])
def test_what_was_not_read_is_known_as_such(scene: Frame, pyramid: Pyramid, nothing: float):
    depth = np.full_like(scene.depth, nothing)
    views = window_views(pyramid, depth, 220.0, windows((60.0, 40.0, 100.0, 60.0)), 2)
    _, relative, is_read, scalars, _ = parts_of(views)
    assert not relative.any() and not is_read.any()
    assert scalars[0, 2] == DISTANCE and scalars[0, 3] == 0.0
    assert np.isfinite(views).all()


def test_windows_at_the_edge_and_none(scene: Frame, pyramid: Pyramid):
    around = windows((-30.0, -30.0, 20.0, 20.0), (200.0, 140.0, 300.0, 260.0), (0.0, 0.0, 2.0, 1.0))
    assert np.isfinite(window_views(pyramid, scene.depth, 220.0, around, 2)).all()
    assert window_views(pyramid, scene.depth, 220.0, windows(), 2).shape == (0, view_size(CHANNELS, 2))
