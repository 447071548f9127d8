"""The projected solid against what it lies between; `test_projections` has what it shares with the ellipsoid's."""

from __future__ import annotations

import numpy as np
from convex_bodies import SOLID, box_of_points
from hypothesis import assume, given
from views_of_volumes import STEADY, random_view, seeds

from thingmap.factors.solid import project_solid
from thingmap.factors.volume import project_volume


@STEADY
@given(seeds)
def test_it_lies_between_the_ellipsoid_and_the_box_of_its_extents(seed):
    pose, R, center, size = random_view(seed)
    corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * np.exp(size)
    assume(SOLID.nearest_depth(pose, R, center, size) > 0.3)
    assume(((center + corners @ R.T - pose.translation()) @ pose.rotation().matrix())[:, 2].min() > 0.1)
    sides = np.array([-1.0, -1.0, 1.0, 1.0])
    solid = sides * project_solid(pose.matrix(), R, center, size).xyxy
    ellipsoid = sides * project_volume(pose.matrix(), R, center, size).xyxy
    assert (ellipsoid <= solid + 1e-12).all()
    assert (solid <= sides * box_of_points(pose, R, center, corners) + 1e-12).all()


def test_from_afar_it_is_as_large_as_its_extents():
    """Seen along one of its axes, from a thousand times its size."""
    half_axes = np.array([0.3, 0.2, 0.4])
    for axis in range(3):
        right, down = (axis + 1) % 3, (axis + 2) % 3
        R_camera_upright = np.zeros((3, 3))
        R_camera_upright[0, right] = R_camera_upright[1, down] = R_camera_upright[2, axis] = 1.0
        box = project_solid(np.eye(4), R_camera_upright, np.array([0.0, 0.0, 300.0]), np.log(half_axes)).xyxy
        expected = np.array([-half_axes[right], -half_axes[down], half_axes[right], half_axes[down]]) / 300.0
        np.testing.assert_allclose(box, expected, rtol=2e-3)
