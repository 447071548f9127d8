"""The projected ellipsoid and solid, against points on their surfaces and against numerical derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from convex_bodies import ELLIPSOID, SOLID, Body, box_of_points
from hypothesis import assume, given
from hypothesis import strategies as st
from views_of_volumes import STEADY, numerical_jacobian, random_view, seeds

from thingmap.datasets.frame import Intrinsics
from thingmap.factors.volume import NEAR_MARGIN_M

both = pytest.mark.parametrize("body", [ELLIPSOID, SOLID], ids=["ellipsoid", "solid"])


@both
@STEADY
@given(seed=seeds)
def test_box_is_the_box_of_the_surface(body: Body, seed: int):
    pose, R, center, size = random_view(seed)
    assume(body.nearest_depth(pose, R, center, size) > 0.3)
    projection = body.project(pose.matrix(), R, center, size)
    expected = box_of_points(pose, R, center, body.surface(size))
    extent = (expected[2:] - expected[:2]).max()
    assert projection.in_front
    np.testing.assert_allclose(projection.xyxy, expected, atol=2e-3 * extent)
    inwards = np.array([1.0, 1.0, -1.0, -1.0]) * (expected - projection.xyxy)
    assert inwards.min() > -1e-9  # no point lies outside


@both
@STEADY
@given(seed=seeds)
def test_jacobians_are_the_derivatives(body: Body, seed: int):
    pose, R, center, size = random_view(seed)
    assume(body.nearest_depth(pose, R, center, size) > NEAR_MARGIN_M + 1e-3)
    projection = body.project(pose.matrix(), R, center, size)
    J = np.hstack([projection.J_pose, projection.J_center, projection.J_size])
    numerical = numerical_jacobian(body.project, pose, R, center, size)
    np.testing.assert_allclose(J, numerical, atol=1e-6 * (1 + np.abs(J).max()))


@both
@STEADY
@given(seed=seeds, beyond=st.floats(1e-4, 0.02))
def test_jacobians_stay_bounded_next_to_the_guard(body: Body, seed: int, beyond: float):
    pose, R, center, size = random_view(seed)
    near = body.nearest_depth(pose, R, center, size)
    center = center + (NEAR_MARGIN_M + beyond - near) * pose.rotation().matrix()[:, 2]
    projection = body.project(pose.matrix(), R, center, size)
    J = np.hstack([projection.J_pose, projection.J_center, projection.J_size])
    assert projection.in_front
    normal = np.hypot(1.0, np.abs(projection.xyxy).max())
    reach = np.linalg.norm(pose.transformTo(center)) + (body.summands * np.exp(size)).max(axis=1).sum()
    assert np.abs(J).max() <= normal * max(reach, 1.0) / NEAR_MARGIN_M


@both
@STEADY
@given(seed=seeds, behind=st.floats(-3.0, -1e-4))
def test_what_reaches_the_camera_is_switched_off(body: Body, seed: int, behind: float):
    pose, R, center, size = random_view(seed)
    near = body.nearest_depth(pose, R, center, size)
    center = center + (NEAR_MARGIN_M + behind - near) * pose.rotation().matrix()[:, 2]
    projection = body.project(pose.matrix(), R, center, size)
    assert not projection.in_front
    assert np.isnan(projection.xyxy).all()
    assert not projection.J_pose.any() and not projection.J_center.any() and not projection.J_size.any()


@both
def test_values_that_are_no_numbers_are_switched_off(body: Body):
    for center, size in [([0, 0, np.nan], [-2, -2, -2]), ([0, 0, 2], [np.nan, -2, -2]), ([0, 0, 2], [900, -2, -2])]:
        projection = body.project(np.eye(4), np.eye(3), np.array(center, float), np.array(size, float))
        assert not projection.in_front
        assert np.isfinite(projection.J_size).all()


@both
def test_many_in_pixels_as_one_by_one(body: Body):
    intrinsics = Intrinsics(640, 480, 525.0, 530.0, 319.5, 239.5)
    pose, R, _, _ = random_view(3)
    rng = np.random.default_rng(0)
    centers = pose.translation() + rng.normal(size=(40, 3)) * 2.0
    sizes = np.log(rng.uniform(0.02, 0.3, (40, 3)))
    xyxy, in_front = body.project_all(pose.matrix(), R, centers, sizes, intrinsics)
    assert 5 < in_front.sum() < 35
    for i in range(40):
        one = body.project(pose.matrix(), R, centers[i], sizes[i])
        pixels = one.xyxy * [525.0, 530.0, 525.0, 530.0] + [319.5, 239.5, 319.5, 239.5]
        np.testing.assert_allclose(xyxy[i], pixels, rtol=1e-12)
        assert in_front[i] == one.in_front
    assert body.project_all(pose.matrix(), R, np.empty((0, 3)), np.empty((0, 3)), intrinsics)[0].shape == (0, 4)
