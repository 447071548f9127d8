"""What only the ellipsoid's projection has; `test_projections` has what it shares with the solid's."""

from __future__ import annotations

import numpy as np
from convex_bodies import ELLIPSOID
from hypothesis import given
from hypothesis import strategies as st
from views_of_volumes import STEADY, numerical_jacobian, random_view, seeds

from thingmap.factors.volume import NEAR_MARGIN_M, project_volume


@STEADY
@given(seeds, st.floats(1e-4, 0.02))
def test_jacobians_stay_true_next_to_the_guard(seed, beyond):
    pose, R, center, size = random_view(seed)
    near = ELLIPSOID.nearest_depth(pose, R, center, size)
    center = center + (NEAR_MARGIN_M + beyond - near) * pose.rotation().matrix()[:, 2]
    projection = project_volume(pose.matrix(), R, center, size)
    J = np.hstack([projection.J_pose, projection.J_center, projection.J_size])
    assert projection.in_front
    numerical = numerical_jacobian(project_volume, pose, R, center, size, h=1e-7)
    np.testing.assert_allclose(J, numerical, atol=1e-4 * (1 + np.abs(J).max()))


def test_sphere_by_hand():
    """A sphere of radius r at distance d covers r / sqrt(d^2 - r^2) to either side."""
    projection = project_volume(np.eye(4), np.eye(3), np.array([0.0, 0.0, 2.0]), np.log([0.5, 0.5, 0.5]))
    half = 0.5 / np.sqrt(4.0 - 0.25)
    np.testing.assert_allclose(projection.xyxy, [-half, -half, half, half], rtol=1e-12)
