"""The projected ellipsoid against points on its surface and against numerical derivatives."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))  # tests are imported one by one
from views_of_volumes import STEADY, numerical_jacobian, random_view, seeds

from thingmap.datasets.frame import Intrinsics
from thingmap.factors.volume import NEAR_MARGIN_M, project_volume, project_volumes


def surface(R_world_upright: np.ndarray, center: np.ndarray, log_half_axes: np.ndarray) -> np.ndarray:
    """(N, 3) points all over an ellipsoid."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, 101), np.linspace(0, 2 * np.pi, 201))
    ball = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
    return center + (ball.reshape(-1, 3) * np.exp(log_half_axes)) @ R_world_upright.T


def depth_of_nearest_point(pose, R_world_upright, center, log_half_axes) -> float:
    axes = pose.rotation().matrix().T @ R_world_upright * np.exp(log_half_axes)
    return float(pose.transformTo(center)[2] - np.linalg.norm(axes[2]))


@STEADY
@given(seeds)
def test_box_is_the_box_of_the_surface(seed):
    pose, R, center, size = random_view(seed)
    assume(depth_of_nearest_point(pose, R, center, size) > 0.3)
    projection = project_volume(pose.matrix(), R, center, size)
    points = (surface(R, center, size) - pose.translation()) @ pose.rotation().matrix()
    rays = points[:, :2] / points[:, 2:]
    expected = np.concatenate([rays.min(axis=0), rays.max(axis=0)])
    extent = (expected[2:] - expected[:2]).max()
    assert projection.in_front
    np.testing.assert_allclose(projection.xyxy, expected, atol=2e-3 * extent)


@STEADY
@given(seeds)
def test_jacobians_are_the_derivatives(seed):
    pose, R, center, size = random_view(seed)
    assume(depth_of_nearest_point(pose, R, center, size) > NEAR_MARGIN_M + 1e-3)
    projection = project_volume(pose.matrix(), R, center, size)
    J = np.hstack([projection.J_pose, projection.J_center, projection.J_size])
    np.testing.assert_allclose(
        J, numerical_jacobian(project_volume, pose, R, center, size), atol=1e-6 * (1 + np.abs(J).max())
    )


@STEADY
@given(seeds, st.floats(1e-4, 0.02))
def test_jacobians_stay_true_and_bounded_next_to_the_guard(seed, beyond):
    pose, R, center, size = random_view(seed)
    near = depth_of_nearest_point(pose, R, center, size)
    center = center + (NEAR_MARGIN_M + beyond - near) * pose.rotation().matrix()[:, 2]
    projection = project_volume(pose.matrix(), R, center, size)
    J = np.hstack([projection.J_pose, projection.J_center, projection.J_size])
    assert projection.in_front
    numerical = numerical_jacobian(project_volume, pose, R, center, size, h=1e-7)
    np.testing.assert_allclose(J, numerical, atol=1e-4 * (1 + np.abs(J).max()))
    normal = np.hypot(1.0, np.abs(projection.xyxy).max())
    reach = np.linalg.norm(pose.transformTo(center)) + np.exp(size).max()
    assert np.abs(J).max() <= normal * max(reach, 1.0) / NEAR_MARGIN_M


@STEADY
@given(seeds, st.floats(-3.0, -1e-4))
def test_a_volume_that_reaches_the_camera_is_switched_off(seed, behind):
    pose, R, center, size = random_view(seed)
    near = depth_of_nearest_point(pose, R, center, size)
    center = center + (NEAR_MARGIN_M + behind - near) * pose.rotation().matrix()[:, 2]
    projection = project_volume(pose.matrix(), R, center, size)
    assert not projection.in_front
    assert np.isnan(projection.xyxy).all()
    assert not projection.J_pose.any() and not projection.J_center.any() and not projection.J_size.any()


def test_sphere_by_hand():
    """A sphere of radius r at distance d covers r / sqrt(d^2 - r^2) to either side."""
    projection = project_volume(np.eye(4), np.eye(3), np.array([0.0, 0.0, 2.0]), np.log([0.5, 0.5, 0.5]))
    half = 0.5 / np.sqrt(4.0 - 0.25)
    np.testing.assert_allclose(projection.xyxy, [-half, -half, half, half], rtol=1e-12)


def test_values_that_are_no_numbers_are_switched_off():
    for center, size in [([0, 0, np.nan], [-2, -2, -2]), ([0, 0, 2], [np.nan, -2, -2]), ([0, 0, 2], [900, -2, -2])]:
        projection = project_volume(np.eye(4), np.eye(3), np.array(center, float), np.array(size, float))
        assert not projection.in_front
        assert np.isfinite(projection.J_size).all()


def test_many_volumes_in_pixels_as_one_by_one():
    intrinsics = Intrinsics(640, 480, 525.0, 530.0, 319.5, 239.5)
    pose, R, _, _ = random_view(3)
    rng = np.random.default_rng(0)
    centers = pose.translation() + rng.normal(size=(40, 3)) * 2.0
    sizes = np.log(rng.uniform(0.02, 0.3, (40, 3)))
    xyxy, in_front = project_volumes(pose.matrix(), R, centers, sizes, intrinsics)
    assert 5 < in_front.sum() < 35
    for i in range(40):
        one = project_volume(pose.matrix(), R, centers[i], sizes[i])
        pixels = one.xyxy * [525.0, 530.0, 525.0, 530.0] + [319.5, 239.5, 319.5, 239.5]
        np.testing.assert_allclose(xyxy[i], pixels, rtol=1e-12)
        assert in_front[i] == one.in_front
    assert project_volumes(pose.matrix(), R, np.empty((0, 3)), np.empty((0, 3)), intrinsics)[0].shape == (0, 4)
