"""The up direction: residual by hand, derivatives, and a graph that finds up from tilted cameras."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.factors.attitude import attitude_factor, up_prior

X, U = gtsam.symbol("x", 0), gtsam.symbol("u", 0)


def values_of(pose: gtsam.Pose3, up: np.ndarray) -> gtsam.Values:
    values = gtsam.Values()
    values.insert(X, pose)
    values.insert(U, gtsam.Unit3(np.asarray(up, float)))
    return values


def unit(vector) -> np.ndarray:
    return np.asarray(vector, float) / np.linalg.norm(vector)


def test_residual_is_the_sine_of_the_angle():
    """Small enough for the quadratic part of Huber's loss."""
    angle, sigma = 0.01, 0.02
    factor = attitude_factor(X, U, np.array([0.0, -9.81, 0.0]), sigma)  # up is -y in an upright camera
    tilted = gtsam.Pose3(gtsam.Rot3.Rx(angle), np.array([1.0, 2.0, 3.0]))
    for pose, expected in [(gtsam.Pose3(), 0.0), (tilted, 0.5 * (np.sin(angle) / sigma) ** 2)]:
        assert factor.error(values_of(pose, [0.0, -1.0, 0.0])) == pytest.approx(expected, abs=1e-20)


@settings(deadline=None, derandomize=True, max_examples=100)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.4), st.floats(0.005, 2.0))
def test_gradient_of_the_whole_factor(seed, angle, sigma):
    rng = np.random.default_rng(seed)
    pose = gtsam.Pose3(gtsam.Rot3.Expmap(rng.normal(size=3)), rng.normal(size=3))
    measured = unit(rng.normal(size=3))
    away = unit(np.cross(measured, rng.normal(size=3)))
    up = pose.rotation().matrix() @ (np.cos(angle) * measured + np.sin(angle) * away)
    factor, unit3, h = attitude_factor(X, U, measured, sigma), gtsam.Unit3(up), 1e-6
    A, b = factor.linearize(values_of(pose, up)).jacobian()
    gradient = -A.T @ b

    def error(k: int, step: float) -> float:
        d = step * np.eye(8)[k]
        values = gtsam.Values()
        values.insert(X, pose.retract(d[:6]))
        values.insert(U, unit3.retract(d[6:]))
        return factor.error(values)

    numerical = np.array([(error(k, h) - error(k, -h)) / (2 * h) for k in range(8)])
    np.testing.assert_allclose(gradient, numerical, atol=2e-5 * (1.0 + np.abs(gradient).max()))


def test_up_is_found_from_tilted_cameras_with_known_poses():
    rng = np.random.default_rng(0)
    up = unit([0.1, -0.9, 0.3])
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for i in range(8):
        pose = gtsam.Pose3(gtsam.Rot3.Expmap(0.5 * rng.normal(size=3)), rng.normal(size=3))
        graph.add(gtsam.PriorFactorPose3(X + i, pose, gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)))
        graph.add(attitude_factor(X + i, U, pose.rotation().matrix().T @ up, 0.02))
        values.insert(X + i, pose)
    values.insert(U, gtsam.Unit3(np.array([0.0, -1.0, 0.0])))
    parameters = gtsam.ISAM2Params()
    parameters.setRelinearizeThreshold(1e-6)
    parameters.relinearizeSkip = 1
    isam = gtsam.ISAM2(parameters)
    isam.update(graph, values)
    for _ in range(8):
        isam.update()
    np.testing.assert_allclose(isam.calculateEstimate().atUnit3(U).point3(), up, atol=1e-6)


def test_a_known_up_rights_a_tilted_camera_but_not_its_heading():
    """With up fixed, roll and pitch follow the accelerometer; the heading stays where the pose prior puts it."""
    graph = gtsam.NonlinearFactorGraph()
    graph.add(gtsam.PriorFactorPose3(X, gtsam.Pose3(), gtsam.noiseModel.Diagonal.Sigmas([1.0] * 3 + [0.01] * 3)))
    graph.add(up_prior(U, np.array([0.0, 0.0, 1.0]), 1e-4))
    truth = gtsam.Rot3.Rx(0.2)
    graph.add(attitude_factor(X, U, truth.matrix().T @ [0.0, 0.0, 1.0], 1e-3))
    values = values_of(gtsam.Pose3(), np.array([0.02, 0.0, 1.0]))
    solution = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    np.testing.assert_allclose(solution.atPose3(X).rotation().matrix(), truth.matrix(), atol=1e-4)


@pytest.mark.parametrize("bad", [np.zeros(3), np.array([0.0, np.nan, 1.0]), np.ones(4)])
def test_bad_directions_are_refused(bad):
    for use in (attitude_factor, lambda x, u, up, sigma: up_prior(u, up, sigma)):
        with pytest.raises(ValueError, match="up direction"):
            use(X, U, bad, 0.1)


def test_sigma_must_be_positive():
    with pytest.raises(ValueError, match="sigma_rad"):
        attitude_factor(X, U, np.array([0.0, 0.0, 1.0]), 0.0)
