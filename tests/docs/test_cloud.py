"""The cloud's image: what is near covers what is far, and what stands in the way is left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from drawing.cloud import draw_cloud, in_sight, spacing_of, splat
from drawing.scene import Scene, choose_view

from thingmap.datasets.frame import Intrinsics


def test_nearer_points_cover_farther_ones_and_a_tall_wall_in_front_is_left_out(
    scene: Scene, pixels: Callable[..., np.ndarray]
) -> None:
    table = scene.points
    x, y = np.meshgrid(np.arange(-0.6, 0.6, 0.02), np.arange(-0.6, 0.25, 0.02))
    wall = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.4)], axis=1)  # between the viewer and the things
    under = table + np.array([0.0, 0.2, 0.0])
    points = np.concatenate([under, table, wall])
    parts = np.repeat([0, 1, 2], [len(under), len(table), len(wall)])
    colors = np.array([(0, 255, 0), (255, 0, 0), (0, 0, 255)], dtype=np.uint8)[parts]
    scene = replace(scene, points=points, colors=colors)
    view = choose_view(scene, 400, elevation=50.0)
    seen = in_sight(scene, view, 0.02)
    assert seen[parts == 1].mean() > 0.98 and not seen[(parts == 2) & (points[:, 1] < -0.1)].any()
    image, depth = draw_cloud(scene, view)
    u, v = np.round(pixels(view, np.array([[0.0, 0.25, 1.2]]))[0]).astype(int)
    assert image[v, u, 0] > 150 and image[v, u, 1] < 60 and image[v, u, 2] < 60
    assert depth[v, u] == pytest.approx(view.to_view(np.array([[0.0, 0.25, 1.2]]))[0, 2], abs=0.03)
    assert np.isinf(depth[0, 0])


def test_a_point_is_a_disc_of_its_colour_at_its_depth() -> None:
    k = Intrinsics(160, 60, 100.0, 100.0, 39.5, 29.5)
    points, colors = np.array([[0.105, 0.005, 1.0], [0.21, 0.01, 2.0]]), np.array([[250, 10, 20], [10, 250, 20]])
    color, depth = splat(points, colors.astype(np.uint8), k, 0.02)
    v, u = np.nonzero(np.isfinite(depth))
    assert u.mean() == pytest.approx(50.0) and v.mean() == pytest.approx(30.0)  # 100 * 0.105 + 39.5
    assert np.hypot(u - 50.0, v - 30.0).max() == pytest.approx(2.0)  # the smallest: 0.75 * 0.02 * 100 is less
    assert np.allclose(depth[v, u], 1.0) and np.allclose(color[v, u], colors[0], atol=0.1)


def test_a_point_outside_the_image_is_no_error() -> None:
    k = Intrinsics(160, 60, 100.0, 100.0, 39.5, 29.5)
    color, depth = splat(np.array([[9.0, 0.0, 1.0]]), np.zeros((1, 3), dtype=np.uint8), k, 0.02)
    assert color.shape == (60, 160, 3) and np.isinf(depth).all()


def test_spacing_is_that_of_the_grid_and_defined_for_one_point(scene: Scene) -> None:
    assert spacing_of(scene.points) == pytest.approx(0.02)
    assert spacing_of(scene.points[:1]) == 0.001
