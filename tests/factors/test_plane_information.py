"""The covariance of a registration: against the exact Hessian, Monte Carlo, and scenes that leave directions open."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest
from scipy.spatial import cKDTree

from thingmap.factors.plane_information import (
    NEIGHBOURS,
    RADIUS_M,
    SAMPLES,
    SIGMA_FLOOR_M,
    _nearest,
    point_to_plane_covariance,
)

# Walls of a room with one side open: axis of the normal and where the wall stands, metres.
WALLS = ((0, -1.5), (0, 1.5), (1, -1.2), (1, 1.2), (2, 2.0))
POSE = gtsam.Pose3(gtsam.Rot3.Expmap(np.array([0.1, -0.2, 0.05])), np.array([0.1, 0.05, -0.2]))


def room(rng: np.random.Generator, count: int, margin: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) points on the walls, world frame, and (N,) their walls; `margin` keeps away from the corners."""
    wall = rng.integers(0, len(WALLS), count)
    points = rng.uniform(-1.0, 1.0, (count, 3)) * (np.array([1.5, 1.2, 2.0]) - margin)
    for i, (axis, where) in enumerate(WALLS):
        points[wall == i, axis] = where
    return points, wall


def seen_from(pose: gtsam.Pose3, points: np.ndarray) -> np.ndarray:
    return (points - pose.translation()) @ pose.rotation().matrix()


def normals_of(wall: np.ndarray) -> np.ndarray:
    return np.eye(3)[[WALLS[i][0] for i in wall]]


def offsets(pose: gtsam.Pose3, source: np.ndarray, wall: np.ndarray) -> np.ndarray:
    """(N,) signed distances of camera-frame points from the walls they belong to."""
    points = source @ pose.rotation().matrix().T + pose.translation()
    return np.einsum("ni,ni->n", normals_of(wall), points) - np.array([WALLS[i][1] for i in wall])


def derivative(pose: gtsam.Pose3, source: np.ndarray, wall: np.ndarray) -> np.ndarray:
    """(N, 6) numerical derivative of the distances by the pose's right tangent."""
    h = 1e-6
    both = [[offsets(pose.retract(s * h * np.eye(6)[k]), source, wall) for s in (1.0, -1.0)] for k in range(6)]
    return np.stack([(plus - minus) / (2 * h) for plus, minus in both], axis=1)


def test_information_without_noise_is_the_hessian_of_the_distances():
    rng = np.random.default_rng(0)
    points, wall = room(rng, 250, margin=0.3)
    source = seen_from(POSE, points)
    result = point_to_plane_covariance(source, POSE.matrix(), room(rng, 40000)[0])
    J = derivative(POSE, source, wall)
    assert result.pairs == 250
    assert result.residual_sigma_m == pytest.approx(SIGMA_FLOOR_M)
    expected = J.T @ J / SIGMA_FLOOR_M**2
    np.testing.assert_allclose(result.information, expected, atol=1e-5 * np.abs(expected).max())


def test_errors_of_many_registrations_are_as_large_as_predicted():
    """Points and map with 4 mm of noise, registered by least squares on the true walls."""
    rng = np.random.default_rng(1)
    squares = []
    for _ in range(60):
        points, wall = room(rng, 200, margin=0.2)
        source = seen_from(POSE, points) + 0.004 * rng.normal(size=(200, 3))
        pose = POSE
        for _ in range(4):
            J, r = derivative(pose, source, wall), offsets(pose, source, wall)
            pose = pose.retract(-np.linalg.solve(J.T @ J, J.T @ r))
        world = room(rng, 8000)[0]
        result = point_to_plane_covariance(source, pose.matrix(), world + 0.004 * rng.normal(size=world.shape))
        error = gtsam.Pose3.Logmap(POSE.between(pose))
        squares.append(error @ result.information @ error / 6.0)
    assert 0.6 < np.mean(squares) < 1.4
    assert 0.4 < np.median(squares) < 1.4


@pytest.mark.parametrize("density", [2000, 20000])
def test_a_bare_wall_leaves_its_own_directions_open(density):
    """Only distance and two tilts of a wall at z = 2 are seen; noise of the map must not fake the rest."""
    rng = np.random.default_rng(2)

    def wall(count: int, half: float) -> np.ndarray:
        return np.c_[rng.uniform(-half, half, (count, 2)), 2.0 + 0.005 * rng.normal(size=count)]

    result = point_to_plane_covariance(wall(20000, 1.0), np.eye(4), wall(density, 1.5))
    sigma = np.sqrt(np.diag(result.covariance(guess_sigma_rad=0.1, guess_sigma_m=0.2)))
    assert result.translation_eigenvalue_ratio < 0.002
    assert 0.003 < result.residual_sigma_m < 0.007
    assert sigma[5] < 0.002  # along the normal: known
    assert (sigma[3:5] > 0.010).all()  # along the wall: far vaguer than the 5 mm of noise
    assert (sigma[:2] < 0.002).all() and sigma[2] > 0.010  # tilts known, the turn about the normal not
    assert (sigma[3:] <= 0.2).all() and (sigma[:3] <= 0.1).all()
    normal = room(rng, 20000)[0]
    assert point_to_plane_covariance(normal, np.eye(4), normal).translation_eigenvalue_ratio > 0.1


def test_a_noise_free_wall_is_exactly_open_and_its_covariance_still_usable():
    rng = np.random.default_rng(3)
    wall = np.c_[rng.uniform(-1.0, 1.0, (20000, 2)), np.full(20000, 2.0)]
    result = point_to_plane_covariance(wall, np.eye(4), wall)
    covariance = result.covariance()
    assert result.translation_eigenvalue_ratio == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance))[3:5], 0.2, rtol=1e-3)
    np.linalg.cholesky(covariance)


@pytest.mark.parametrize(("source", "world"), [(0, 1000), (1000, 0), (1000, 3), (0, 0)])
def test_nothing_to_match_is_no_information(source, world):
    rng = np.random.default_rng(4)
    result = point_to_plane_covariance(room(rng, source)[0], np.eye(4), room(rng, world)[0])
    assert result.pairs == 0 and not result.information.any() and result.translation_eigenvalue_ratio == 0.0
    assert np.isnan(result.residual_sigma_m)
    np.testing.assert_allclose(np.diag(result.covariance(0.1, 0.2)), [0.01] * 3 + [0.04] * 3)


def test_the_same_input_gives_the_same_answer_and_the_sample_is_capped():
    rng = np.random.default_rng(5)
    source, world = room(rng, 5000)[0], room(rng, 20000)[0] + 0.003 * rng.normal(size=(20000, 3))
    first, again = (point_to_plane_covariance(source, np.eye(4), world, seed=7) for _ in range(2))
    other = point_to_plane_covariance(source, np.eye(4), world, seed=8)
    np.testing.assert_array_equal(first.information, again.information)
    assert not np.array_equal(first.information, other.information)
    assert 200 < first.pairs <= SAMPLES


def test_neighbours_are_those_of_a_search_tree():
    rng = np.random.default_rng(6)
    world, points = rng.normal(size=(4000, 3)), rng.normal(size=(200, 3))
    distances, expected = cKDTree(world).query(points, NEIGHBOURS, distance_upper_bound=RADIUS_M)
    expected[~np.isfinite(distances)] = -1
    assert (expected >= 0).any() and (expected < 0).any()
    np.testing.assert_array_equal(_nearest(points, world, NEIGHBOURS, RADIUS_M), expected)
