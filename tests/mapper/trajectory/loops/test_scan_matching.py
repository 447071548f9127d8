"""Motion between keyframes from their depth: how wrong it is and says it is, walls, and what must be refused."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from thingmap.datasets.frame import Frame
from thingmap.mapper.config import OdometryConfig, ScanConfig
from thingmap.mapper.trajectory.depth_points import DepthPoints
from thingmap.mapper.trajectory.loops.scan_matching import PreparedScan, Scan, match_scans
from thingmap.mapper.trajectory.rigid import inverse

from .box_room import depth_points, pose, retracted, tangent

CONFIG = ScanConfig()
WALL = [((0.0, 0.0, 1.0), 1.5)]
CORNER = [((0.0, 0.0, 1.0), 1.8), ((1.0, 0.0, 0.0), 0.8), ((0.0, 1.0, 0.0), 0.7)]
SLID = retracted(np.eye(4), np.array([0.0, 0.01, 0.0, 0.02, 0.01, 0.02]))


def prepared(points: np.ndarray) -> PreparedScan:
    return PreparedScan(Scan.of(points, CONFIG.spacing), CONFIG)


def of_frame(frame: Frame, pixel_step: int = 1) -> PreparedScan:
    numbers = OdometryConfig()
    return prepared(DepthPoints(pixel_step, numbers.min_range, numbers.max_range)(frame))


@pytest.fixture(scope="module")
def table(tabletop) -> dict[int, tuple[np.ndarray, PreparedScan]]:
    """Poses and scans of some rendered frames, up to 0.3 m apart."""
    step = OdometryConfig().pixel_step
    return {i: (tabletop[i].T_world_camera, of_frame(tabletop[i], step)) for i in range(0, 30, 7)}


def test_rendered_keyframes_are_as_far_off_as_they_say(table):
    rng, errors, squares = np.random.default_rng(0), [], []
    for (T_a, a), (T_b, b) in permutations(table.values(), 2):
        truth = inverse(T_a) @ T_b
        guess = retracted(truth, rng.normal(0.0, np.repeat([0.008, 0.01], 3)))
        found = match_scans(a, b, guess, CONFIG)
        assert found is not None and CONFIG.min_share * len(b.points) < found.inliers <= len(b.points)
        np.linalg.cholesky(found.covariance)
        np.testing.assert_allclose(found.covariance, found.covariance.T, rtol=1e-6, atol=1e-15)
        error = tangent(found.T_a_b, truth)
        errors.append((np.linalg.norm(error[:3]), np.linalg.norm(error[3:])))
        squares.append(error @ np.linalg.solve(found.covariance, error) / 6.0)
    assert len(squares) == 20
    turned, moved = np.array(errors).T
    assert np.median(turned) < 0.002 and turned.max() < 0.005
    assert np.median(moved) < 0.003 and moved.max() < 0.01
    assert 0.2 < np.mean(squares) < 1.5 and max(squares) < 6.0


def test_there_and_back_is_no_motion(table):
    (T_a, a), (T_b, b) = table[0], table[14]
    truth = inverse(T_a) @ T_b
    there, back = match_scans(a, b, truth, CONFIG), match_scans(b, a, inverse(truth), CONFIG)
    assert there is not None and back is not None
    round_trip = tangent(there.T_a_b @ back.T_a_b, np.eye(4))
    assert np.linalg.norm(round_trip[:3]) < 0.003 and np.linalg.norm(round_trip[3:]) < 0.005


def test_a_bare_wall_leaves_its_directions_open(plane_frame):
    first, second = of_frame(plane_frame(WALL)), of_frame(plane_frame(WALL, SLID, 1))
    found = match_scans(first, second, SLID, CONFIG)
    assert found is not None
    sigma = np.sqrt(np.diag(found.covariance))
    assert sigma[2] > 0.03 and (sigma[3:5] > 0.05).all()  # the turn about the normal, and both ways along the wall
    assert (sigma[:2] < 0.005).all() and sigma[5] < 0.005  # tilts and distance: known
    assert abs(tangent(found.T_a_b, SLID)[5]) < 0.005
    corner = match_scans(of_frame(plane_frame(CORNER)), of_frame(plane_frame(CORNER, SLID, 1)), np.eye(4), CONFIG)
    assert corner is not None
    assert (np.sqrt(np.diag(corner.covariance)) < 0.01).all()
    assert np.abs(tangent(corner.T_a_b, SLID)).max() < 0.006


def test_what_hardly_overlaps_is_refused():
    a = prepared(depth_points(pose()))
    b = prepared(depth_points(pose(turn=np.pi)))
    assert match_scans(a, b, pose(turn=np.pi), CONFIG) is None  # the way it is: nothing in common
    assert match_scans(a, a, pose(1.0, 0.3, 1.0, 0.5), CONFIG) is None
    twin = prepared(depth_points(pose(0.01)))
    found = match_scans(a, twin, np.eye(4), CONFIG)
    assert found is not None
    share = found.inliers / min(len(a.points), len(twin.points))
    assert match_scans(a, twin, np.eye(4), replace(CONFIG, min_share=share - 0.001)) is not None
    assert match_scans(a, twin, np.eye(4), replace(CONFIG, min_share=share + 0.001)) is None


@pytest.mark.parametrize("points", [0, 1, 10, 60])
def test_hardly_any_points_are_no_match(points):
    """With all the room's points near ten of them, a fit 2 m off had passed."""
    few, room = prepared(depth_points(pose())[:points]), prepared(depth_points(pose()))
    for a, b in ((few, few), (room, few), (few, room)):
        assert match_scans(a, b, np.eye(4), CONFIG) is None


def test_a_scan_is_thinned_and_single_precision():
    points = depth_points(pose())
    scan = Scan.of(points, 0.1)
    assert scan.points.dtype == np.float32 and scan.points.ndim == 2
    occupied = len(np.unique(np.floor(points / 0.1).astype(int), axis=0))
    assert len(scan.points) == occupied < 0.5 * len(points)
    assert cKDTree(points).query(scan.points)[0].max() < 0.1 * np.sqrt(3.0) / 2.0  # means of what is in a voxel


def test_the_same_scans_give_the_same_motion(table):
    (T_a, a), (T_b, b) = table[0], table[7]
    guess = inverse(T_a) @ T_b
    one = match_scans(a, b, guess, CONFIG)
    again = match_scans(*(PreparedScan(Scan(s.points.astype(np.float32)), CONFIG) for s in (a, b)), guess, CONFIG)
    assert one is not None and again is not None and one.inliers == again.inliers
    np.testing.assert_array_equal(one.T_a_b, again.T_a_b)
    np.testing.assert_array_equal(one.covariance, again.covariance)
