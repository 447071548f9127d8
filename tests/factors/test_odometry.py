"""Poses and covariances are checked before gtsam sees them; residuals by hand."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest

from thingmap.factors.odometry import between_factor, gauge_prior, pose3
from thingmap.factors.robust import HUBER_WIDTH

A, B = gtsam.symbol("x", 0), gtsam.symbol("x", 1)


def transform(rotation=(0.0, 0.0, 0.0), translation=(0.0, 0.0, 0.0)) -> np.ndarray:
    return gtsam.Pose3(gtsam.Rot3.Expmap(np.array(rotation)), np.array(translation)).matrix()


def two_poses(T_a: np.ndarray, T_b: np.ndarray) -> gtsam.Values:
    values = gtsam.Values()
    values.insert(A, gtsam.Pose3(T_a))
    values.insert(B, gtsam.Pose3(T_b))
    return values


def test_a_pose_read_from_text_becomes_exact():
    T = transform((0.3, -0.2, 1.0), (1.0, 2.0, 3.0))
    R = pose3(np.round(T, 4)).rotation().matrix()
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(R, T[:3, :3], atol=2e-4)


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (np.eye(3), "shape"),
        (np.full((4, 4), np.nan), "finite"),
        (np.diag([1.0, 1.0, 1.0, 2.0]), "last row"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "right-handed"),
        (np.diag([1.01, 1.01, 1.01, 1.0]), "orthonormal"),
        (np.diag([0.0, 0.0, 0.0, 1.0]), "orthonormal"),
        (np.eye(4) + 0.01 * np.eye(4, k=1) * [[1], [1], [0], [0]], "orthonormal"),
    ],
)
def test_bad_poses_are_refused(bad, says):
    for use in (
        lambda: pose3(bad),
        lambda: gauge_prior(A, bad, np.full(6, 0.1)),
        lambda: between_factor(A, B, bad, np.eye(6)),
    ):
        with pytest.raises(ValueError, match=says):
            use()


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (np.eye(3), "shape"),
        (np.full((6, 6), np.inf), "finite"),
        (np.eye(6) + np.eye(6, k=1), "symmetric"),
        (np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 0.0]), "positive definite"),
        (np.diag([1.0, 1.0, 1.0, 1.0, 1.0, -1e-3]), "positive definite"),
    ],
)
def test_bad_covariances_are_refused(bad, says):
    with pytest.raises(ValueError, match=says):
        between_factor(A, B, np.eye(4), bad)


@pytest.mark.parametrize("bad", [np.zeros(6), np.full(6, np.nan), np.ones(3)])
def test_bad_sigmas_are_refused(bad):
    with pytest.raises(ValueError, match="six positive"):
        gauge_prior(A, np.eye(4), bad)


def test_covariance_is_rotation_first_in_the_frame_of_b():
    """b is turned a quarter about z: 1 cm along world y is b's x, and 0.02 rad about z stays about z."""
    T_b = transform((0.0, 0.0, np.pi / 2), (1.0, 0.0, 0.0))
    covariance = np.diag([1e-2, 1e-2, 4e-4, 1e-4, 1.0, 1.0])
    factor = between_factor(A, B, T_b, covariance)
    moved = T_b.copy()
    moved[1, 3] += 0.01
    assert factor.error(two_poses(np.eye(4), T_b)) == pytest.approx(0.0, abs=1e-20)
    assert factor.error(two_poses(np.eye(4), moved)) == pytest.approx(0.5, rel=1e-6)
    turned = T_b @ transform((0.0, 0.0, 0.02))
    assert factor.error(two_poses(np.eye(4), turned)) == pytest.approx(0.5, rel=1e-6)


def test_correlated_covariance_is_used_whole():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(6, 6))
    covariance, step = root @ root.T + np.eye(6), 1e-3 * rng.normal(size=6)
    moved = gtsam.Pose3().retract(step).matrix()
    error = between_factor(A, B, np.eye(4), covariance).error(two_poses(np.eye(4), moved))
    logarithm = gtsam.Pose3.Logmap(gtsam.Pose3(moved))
    assert error == pytest.approx(0.5 * logarithm @ np.linalg.solve(covariance, logarithm), rel=1e-9)


def test_a_robust_edge_costs_linearly_and_a_plain_one_squarely():
    values = two_poses(np.eye(4), transform(translation=(10.0, 0.0, 0.0)))
    assert between_factor(A, B, np.eye(4), np.eye(6)).error(values) == pytest.approx(50.0)
    robust = between_factor(A, B, np.eye(4), np.eye(6), robust=True)
    assert robust.error(values) == pytest.approx(HUBER_WIDTH * (10.0 - HUBER_WIDTH / 2))


def test_the_gauge_sits_where_it_is_told():
    T = transform((0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    factor = gauge_prior(A, T, np.array([0.1, 0.1, 0.1, 0.5, 0.5, 0.5]))
    values = gtsam.Values()
    values.insert(A, gtsam.Pose3(T @ transform(translation=(0.0, 0.5, 0.0))))
    assert factor.error(values) == pytest.approx(0.5)
