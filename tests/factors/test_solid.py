"""The projected solid against points on its surface, against what it lies between, and numerical derivatives."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))  # tests are imported one by one
from views_of_volumes import STEADY, numerical_jacobian, random_view, seeds

from thingmap.datasets.frame import Intrinsics
from thingmap.factors.solid import ROUNDNESS, project_solid, project_solids
from thingmap.factors.volume import NEAR_MARGIN_M, project_volume


def reach(directions: np.ndarray, log_half_axes: np.ndarray) -> np.ndarray:
    """(N, 3) points of the solid, about its centre and along its axes, that are farthest along (N, 3) directions."""
    a, r = np.exp(log_half_axes), ROUNDNESS
    points = np.zeros_like(directions)
    for half_axes in (a * [1.0, 1.0, r] / (1.0 + r), a * [r, r, 1.0] / (1.0 + r)):
        points += directions * half_axes**2 / np.linalg.norm(directions * half_axes, axis=1, keepdims=True)
    return points


def surface(log_half_axes: np.ndarray) -> np.ndarray:
    """(N, 3) points all over the solid, about its centre and along its axes, closest where it bends most."""
    polar, around = np.meshgrid(np.linspace(1e-3, np.pi - 1e-3, 301), np.linspace(0, 2 * np.pi, 301))
    ball = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
    return reach(ball.reshape(-1, 3) / np.exp(log_half_axes), log_half_axes)


def depth_of_nearest_point(pose, R_world_upright, center, log_half_axes) -> float:
    towards = -(pose.rotation().matrix().T @ R_world_upright)[2:]
    return float(pose.transformTo(center)[2] - (reach(towards, log_half_axes) @ towards.T)[0, 0])


def seen(pose, R_world_upright, center, points: np.ndarray) -> np.ndarray:
    """(4,) image box of (N, 3) points about a centre, along the upright axes."""
    camera = (center + points @ R_world_upright.T - pose.translation()) @ pose.rotation().matrix()
    rays = camera[:, :2] / camera[:, 2:]
    return np.concatenate([rays.min(axis=0), rays.max(axis=0)])


@STEADY
@given(seeds)
def test_box_is_the_box_of_the_surface(seed):
    pose, R, center, size = random_view(seed)
    assume(depth_of_nearest_point(pose, R, center, size) > 0.3)
    projection = project_solid(pose.matrix(), R, center, size)
    expected = seen(pose, R, center, surface(size))
    extent = (expected[2:] - expected[:2]).max()
    assert projection.in_front
    np.testing.assert_allclose(projection.xyxy, expected, atol=0.01 * extent)
    inwards = np.array([1.0, 1.0, -1.0, -1.0]) * (expected - projection.xyxy)
    assert inwards.min() > -1e-9  # no point lies outside


@STEADY
@given(seeds)
def test_it_lies_between_the_ellipsoid_and_the_box_of_its_extents(seed):
    pose, R, center, size = random_view(seed)
    corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * np.exp(size)
    assume(depth_of_nearest_point(pose, R, center, size) > 0.3)
    assume(((center + corners @ R.T - pose.translation()) @ pose.rotation().matrix())[:, 2].min() > 0.1)
    sides = np.array([-1.0, -1.0, 1.0, 1.0])
    solid = sides * project_solid(pose.matrix(), R, center, size).xyxy
    ellipsoid = sides * project_volume(pose.matrix(), R, center, size).xyxy
    assert (ellipsoid <= solid + 1e-12).all()
    assert (solid <= sides * seen(pose, R, center, corners) + 1e-12).all()


@STEADY
@given(seeds)
def test_jacobians_are_the_derivatives(seed):
    pose, R, center, size = random_view(seed)
    assume(depth_of_nearest_point(pose, R, center, size) > NEAR_MARGIN_M + 1e-3)
    projection = project_solid(pose.matrix(), R, center, size)
    J = np.hstack([projection.J_pose, projection.J_center, projection.J_size])
    np.testing.assert_allclose(
        J, numerical_jacobian(project_solid, pose, R, center, size), atol=2e-6 * (1 + np.abs(J).max())
    )


@STEADY
@given(seeds, st.floats(1e-4, 0.02))
def test_jacobians_stay_bounded_next_to_the_guard(seed, beyond):
    pose, R, center, size = random_view(seed)
    near = depth_of_nearest_point(pose, R, center, size)
    center = center + (NEAR_MARGIN_M + beyond - near) * pose.rotation().matrix()[:, 2]
    projection = project_solid(pose.matrix(), R, center, size)
    J = np.hstack([projection.J_pose, projection.J_center, projection.J_size])
    assert projection.in_front
    normal = np.hypot(1.0, np.abs(projection.xyxy).max())
    reached = np.linalg.norm(pose.transformTo(center)) + 2.0 * np.exp(size).max()
    assert np.abs(J).max() <= normal * max(reached, 1.0) / NEAR_MARGIN_M


@STEADY
@given(seeds, st.floats(-3.0, -1e-4))
def test_a_solid_that_reaches_the_camera_is_switched_off(seed, behind):
    pose, R, center, size = random_view(seed)
    near = depth_of_nearest_point(pose, R, center, size)
    center = center + (NEAR_MARGIN_M + behind - near) * pose.rotation().matrix()[:, 2]
    projection = project_solid(pose.matrix(), R, center, size)
    assert not projection.in_front
    assert np.isnan(projection.xyxy).all()
    assert not projection.J_pose.any() and not projection.J_center.any() and not projection.J_size.any()


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


def test_values_that_are_no_numbers_are_switched_off():
    for center, size in [([0, 0, np.nan], [-2, -2, -2]), ([0, 0, 2], [np.nan, -2, -2]), ([0, 0, 2], [900, -2, -2])]:
        projection = project_solid(np.eye(4), np.eye(3), np.array(center, float), np.array(size, float))
        assert not projection.in_front
        assert np.isfinite(projection.J_size).all()


def test_many_solids_in_pixels_as_one_by_one():
    intrinsics = Intrinsics(640, 480, 525.0, 530.0, 319.5, 239.5)
    pose, R, _, _ = random_view(3)
    rng = np.random.default_rng(0)
    centers = pose.translation() + rng.normal(size=(40, 3)) * 2.0
    sizes = np.log(rng.uniform(0.02, 0.3, (40, 3)))
    xyxy, in_front = project_solids(pose.matrix(), R, centers, sizes, intrinsics)
    assert 0 < in_front.sum() < 40
    for k in range(40):
        single = project_solid(pose.matrix(), R, centers[k], sizes[k])
        assert single.in_front == in_front[k]
        pixels = single.xyxy * [525.0, 530.0, 525.0, 530.0] + [319.5, 239.5, 319.5, 239.5]
        np.testing.assert_allclose(xyxy[k], pixels, atol=1e-9)
    assert project_solids(pose.matrix(), R, np.empty((0, 3)), np.empty((0, 3)), intrinsics)[0].shape == (0, 4)
