"""The depth image of a map: splats of its cloud, ellipsoids of its things."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.frame import Intrinsics
from thingmap.mapper.queries.depth_image import CLEAR, draw_ellipsoids, draw_points, empty_depth, smaller

CAMERA = Intrinsics(64, 48, 50.0, 50.0, 31.5, 23.5)
HERE = np.eye(4)


def test_a_point_is_as_wide_as_its_voxel() -> None:
    depth = empty_depth(CAMERA)
    draw_points(depth, np.array([[0.01, 0.01, 1.0]], dtype=np.float32), 0.2, HERE, CAMERA)
    rows, columns = np.nonzero(depth < CLEAR)
    # 50 px/m * 0.2 m = 10 px
    assert np.ptp(rows) + 1 == np.ptp(columns) + 1 == 10
    assert len(rows) == 100
    assert np.all(depth[rows, columns] == 1.0)


def test_a_far_point_still_has_a_pixel_and_the_nearest_point_wins() -> None:
    depth = empty_depth(CAMERA)
    points = np.array([[0.0, 0.0, 3.0], [0.0, 0.0, 2.0], [0.0, 0.0, 2.5]], dtype=np.float32)
    draw_points(depth, points, 0.001, HERE, CAMERA)
    assert np.count_nonzero(depth < CLEAR) >= 1
    assert depth.min() == 2.0


def test_points_behind_the_camera_or_beside_the_image_are_not_drawn() -> None:
    depth = empty_depth(CAMERA)
    points = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.05], [9.0, 0.0, 1.0], [np.nan, 0.0, 1.0]], dtype=np.float32)
    draw_points(depth, points, 0.1, HERE, CAMERA)
    assert np.all(depth == CLEAR)


def test_the_pose_is_that_of_the_camera_in_the_world() -> None:
    T = np.eye(4)
    T[2, 3] = -1.0  # a metre back
    depth = empty_depth(CAMERA)
    draw_points(depth, np.array([[0.0, 0.0, 1.0]], dtype=np.float32), 0.1, T, CAMERA)
    assert depth.min() == 2.0


def test_a_sphere_is_drawn_where_its_surface_is() -> None:
    depth = empty_depth(CAMERA)
    radius = np.log(np.full((1, 3), 0.2))
    draw_ellipsoids(depth, np.array([[0.0, 0.0, 1.0]]), radius, np.eye(3)[None], HERE, CAMERA)
    for row, column in ((23, 31), (20, 35), (28, 27)):
        q = np.array([(column - CAMERA.cx) / CAMERA.fx, (row - CAMERA.cy) / CAMERA.fy, 1.0])
        # |q z - c| = r, the nearer root
        b, c = q @ [0.0, 0.0, 1.0], 1.0 - 0.2**2
        expected = (b - np.sqrt(b * b - (q @ q) * c)) / (q @ q)
        assert depth[row, column] == pytest.approx(expected, abs=1e-6)
    # the outline of a sphere: tan of asin(r / d)
    wide = 50.0 * np.tan(np.arcsin(0.2))
    assert np.count_nonzero(depth[23] < CLEAR) == pytest.approx(2.0 * wide, abs=1.5)


def test_axes_turn_an_ellipsoid() -> None:
    long = np.log([[0.3, 0.05, 0.05]])
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    drawn = []
    for axes in (np.eye(3), turned):
        depth = empty_depth(CAMERA)
        draw_ellipsoids(depth, np.array([[0.0, 0.0, 1.0]]), long, axes[None], HERE, CAMERA)
        rows, columns = np.nonzero(depth < CLEAR)
        drawn.append((np.ptp(rows), np.ptp(columns)))
    assert drawn[0][1] > 3 * drawn[0][0]
    assert drawn[1][0] > 3 * drawn[1][1]


@pytest.mark.parametrize(("width", "k"), [(640, 1), (160, 4), (150, 5)])
def test_a_smaller_camera_sees_the_same(width: int, k: int) -> None:
    camera = Intrinsics(640, 480, 525.0, 520.0, 319.5, 239.5)
    small = smaller(camera, width)
    assert small.width == 640 // k
    points = np.array([[0.3, -0.2, 1.5], [0.0, 0.0, 1.0]])
    # pixel centres at integers: the corner of the image is at -0.5 in both
    np.testing.assert_allclose((small.project(points) + 0.5) * k - 0.5, camera.project(points), atol=1e-9)
