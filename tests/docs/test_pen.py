"""Lines and areas: where they land, what hides them, and the shapes they are given."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from drawing.pen import FRUSTUMS, Pen, ellipse_outline, path_segments
from drawing.scene import Scene, View, choose_view

from thingmap.mapper.map.boxes import EDGES


@pytest.fixture
def view(scene: Scene) -> View:
    return choose_view(scene, 800)


def _pen(view: View, depth: float) -> Pen:
    """On black, with a cloud that is everywhere `depth` metres away."""
    k = view.intrinsics
    black = np.zeros((k.height, k.width, 3), dtype=np.uint8)
    return Pen(view, black, np.full((k.height, k.width), depth, dtype=np.float32))


def test_a_box_covers_just_the_pixels_between_its_projected_corners(
    scene: Scene, view: View, pixels: Callable[..., np.ndarray]
) -> None:
    pen = _pen(view, np.inf)
    corners = scene.things[0].corners(scene.R_world_upright)
    pen.segments(corners[EDGES], (255, 255, 255), 1.0)
    v, u = np.nonzero(pen.image[..., 0] > 100)
    expected = pixels(view, corners)
    assert np.allclose([u.min(), v.min()], expected.min(axis=0), atol=2.0)
    assert np.allclose([u.max(), v.max()], expected.max(axis=0), atol=2.0)


def test_what_the_cloud_hides_is_fainter(scene: Scene, view: View) -> None:
    edges = scene.things[0].corners(scene.R_world_upright)[EDGES]
    shown, hidden = _pen(view, np.inf), _pen(view, 0.1)
    for pen in (shown, hidden):
        pen.segments(edges, (255, 255, 255), 2.0)
    assert 0 < hidden.image.max() < 0.6 * shown.image.max()


def test_an_area_lets_half_of_the_picture_through(view: View) -> None:
    pen = _pen(view, np.inf)
    pen.area(np.array([[100.0, 100.0], [200.0, 100.0], [200.0, 200.0], [100.0, 200.0]]), (200, 100, 0), 1.0)
    assert np.allclose(pen.image[150, 150], (100, 50, 0), atol=1)
    assert pen.image[100, 150].min() > 150  # the rim is white
    assert not pen.image[:95].any() and not pen.image[:, 205:].any()


def test_the_ellipse_holds_the_mass_of_two_sigmas(scene: Scene, view: View, pixels: Callable[..., np.ndarray]) -> None:
    cup = scene.things[0]
    samples = np.random.default_rng(0).multivariate_normal(cup.position, cup.position_covariance, 4000)
    outline = ellipse_outline(view, cup).astype(np.float32)[:, None]
    inside = [cv2.pointPolygonTest(outline, (float(u), float(v)), False) >= 0 for u, v in pixels(view, samples)]
    assert np.mean(inside) == pytest.approx(1.0 - np.exp(-2.0), abs=0.02)


def test_the_path_joins_the_poses_and_shows_cameras_as_pyramids(scene: Scene) -> None:
    segments = path_segments(scene.poses, 0.1)
    steps, cameras = segments[: len(scene.poses) - 1], segments[len(scene.poses) - 1 :]
    assert np.allclose(steps[:, 0], scene.poses[:-1, :3, 3]) and np.allclose(steps[:, 1], scene.poses[1:, :3, 3])
    assert len(cameras) == FRUSTUMS * 8  # four edges from the tip, four of the rim
    assert np.allclose(np.unique(cameras[..., 2].round(9)), [0.0, 0.1])  # the camera looks along z
    assert {scene.poses[0, 0, 3], scene.poses[-1, 0, 3]} <= set(cameras[:, 0, 0])  # the first and the last are shown


def test_a_camera_that_stood_still_is_shown_once(scene: Scene) -> None:
    segments = path_segments(np.repeat(scene.poses[:1], 3, axis=0), 0.1)
    assert len(segments) == 2 + 8
