"""The incremental graph on cases that can be solved by hand or at once."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L, S, X

from thingmap.mapper.config import SmootherConfig
from thingmap.mapper.estimation.records import Box, DepthCentre, Look, Retire, Scores, Visual
from thingmap.mapper.estimation.size_site import SizeSite
from thingmap.mapper.estimation.smoother import Smoother

UP = np.array([0.0, 0.0, 1.0])
HALF_AXES = (0.1, 0.15, 0.2)  # of the objects of `Room.seen_from`


def assert_agrees_with_batch(smoother: Smoother, tools, atol: float = 1e-4) -> None:
    _, values = tools.solve_batch(smoother)
    for t, T in enumerate(smoother.poses()):
        np.testing.assert_allclose(T, values.atPose3(X(t)).matrix(), atol=atol)
    for j in smoother.sites:
        np.testing.assert_allclose(smoother.position(j), values.atPoint3(L(j)), atol=atol)
        np.testing.assert_allclose(smoother.log_size(j), values.atVector(S(j)), atol=atol)


def settled(smoother: Smoother) -> Smoother:
    for _ in range(10):
        smoother.update()
    return smoother


def test_two_views_of_one_object_return_to_the_truth(two_views):
    smoother = settled(two_views((0.1, -0.05, 0.02)).smoother)
    np.testing.assert_allclose(smoother.position(1), [0.1, -0.05, 0.02], atol=2e-4)
    np.testing.assert_allclose(np.exp(smoother.log_size(1)), HALF_AXES, rtol=5e-3)


def test_the_estimate_is_that_of_a_batch_solver(two_views, tools):
    room = two_views((0.1, -0.05, 0.02), (0.4, 0.3, 0.1))
    room.see(1, 2, sides=np.array([3.0, -2.0, 4.0, 1.0]))
    assert_agrees_with_batch(settled(room.smoother), tools)


def test_positions_average_by_their_information(tools):
    """Two depths of one point on the optical axis: 2.0 m, and 2.3 m with twice the sigma, so a quarter of the say."""
    smoother = Smoother(tools.exact, tools.kinect)
    smoother.add_first(np.eye(4), np.full(6, 1e-6), np.array([0.0, -1.0, 0.0]), 0.01)
    smoother.add_landmark(1, np.array([0.0, 0.0, 2.1]), np.log(HALF_AXES), SizeSite(np.log(HALF_AXES), np.eye(3)))
    smoother.add(DepthCentre(0, 1, np.array([0.0, 0.0, 2.0]), 0.1, 0.5, 1.0))
    smoother.add(DepthCentre(0, 1, np.array([0.0, 0.0, 2.3]), 0.1, 1.0, 1.0))
    settled(smoother)
    np.testing.assert_allclose(smoother.position(1), [0.0, 0.0, (4 * 2.0 + 2.3) / 5], atol=2e-4)  # the guard: 10 m
    expected = 1.0 / (1.0 / 0.5**2 + 1.0 / 1.0**2 + 1.0 / 10.0**2)
    assert smoother.position_covariance(1)[2, 2] == pytest.approx(expected, rel=1e-3)


def test_size_without_a_box_is_the_site_and_the_guard(tools):
    smoother = Smoother(tools.exact, tools.kinect)
    smoother.add_first(np.eye(4), np.full(6, 1e-3), np.array([0.0, -1.0, 0.0]), 0.01)
    start, site = np.full(3, -2.0), SizeSite(np.full(3, -1.0), 8.0 * np.eye(3))
    smoother.add_landmark(1, np.array([0.0, 0.0, 2.0]), start, site)
    smoother.update()
    guard = 1.0 / SmootherConfig().guard_size ** 2
    np.testing.assert_allclose(smoother.log_size(1), (guard * start + 8.0 * site.mean) / (guard + 8.0), atol=1e-9)
    np.testing.assert_allclose(smoother.log_size_covariance(1), np.eye(3) / (guard + 8.0), atol=1e-9)


def test_a_new_site_replaces_the_old_one_whether_it_was_solved_or_not(two_views, tools):
    smoother = two_views().smoother
    for mean in (np.full(3, -4.0), np.log(HALF_AXES) + 0.2):  # the first of them never reaches the solver
        smoother.set_site(1, SizeSite(mean, 50.0 * np.eye(3)))
    assert_agrees_with_batch(settled(smoother), tools)
    assert smoother.log_size(1)[0] > np.log(HALF_AXES[0]) + 0.05  # depth, which the boxes know least
    smoother.set_site(1, SizeSite(np.log(HALF_AXES), 4.0 * np.eye(3)))
    np.testing.assert_allclose(settled(smoother).log_size(1), np.log(HALF_AXES), atol=5e-3)
    assert_agrees_with_batch(smoother, tools)


def test_image_features_correct_odometry(tools):
    """Odometry says 0.5 m with 0.1 m, features 0.4 m with 0.05 m: 0.42 m (within Huber's width)."""
    smoother = Smoother(tools.exact, tools.kinect)
    smoother.add_first(np.eye(4), np.full(6, 1e-6), np.array([0.0, -1.0, 0.0]), 0.01)
    smoother.update()
    for record, distance, sigma in ((None, 0.5, 0.1), (Visual, 0.4, 0.05)):
        T = np.eye(4)
        T[0, 3] = distance
        covariance = np.diag([1e-6] * 3 + [sigma**2] * 3)
        smoother.add_keyframe(T, covariance) if record is None else smoother.add(Visual(0, 1, T, covariance))
    settled(smoother)
    assert smoother.pose(1)[0, 3] == pytest.approx(0.42, abs=1e-4)
    assert smoother.pose_covariance(1)[3, 3] == pytest.approx(1.0 / (1.0 / 0.1**2 + 1.0 / 0.05**2), rel=1e-3)


def test_marginals_are_symmetric_and_positive_definite(two_views):
    smoother = two_views((0.0, 0.0, 0.0), (0.3, 0.1, 0.0)).smoother
    for covariance in (
        smoother.pose_covariance(1),
        smoother.position_covariance(1),
        smoother.log_size_covariance(2),
        smoother.difference_covariance(1, 2),
    ):
        np.testing.assert_allclose(covariance, covariance.T, atol=1e-9)
        assert np.linalg.eigvalsh(covariance)[0] > 0.0


def test_marginals_are_those_of_a_batch_solver(two_views, tools):
    smoother = settled(two_views((0.0, 0.0, 0.0), (0.3, 0.1, 0.0)).smoother)
    graph, values = tools.solve_batch(smoother)
    marginals = gtsam.Marginals(graph, values)
    np.testing.assert_allclose(
        smoother.position_covariance(1), marginals.marginalCovariance(L(1)), rtol=0.01, atol=1e-8
    )
    np.testing.assert_allclose(
        smoother.log_size_covariance(2), marginals.marginalCovariance(S(2)), rtol=0.01, atol=1e-7
    )
    joint = marginals.jointMarginalCovariance([L(1), L(2)]).fullMatrix()
    difference = np.hstack([np.eye(3), -np.eye(3)])
    np.testing.assert_allclose(
        smoother.difference_covariance(1, 2), difference @ joint @ difference.T, rtol=0.01, atol=1e-8
    )


def test_the_difference_of_two_objects_seen_from_one_unsure_pose_is_sure(tools):
    """The pose moves both alike: without the cross term the difference would look as unsure as the positions."""
    room = tools.Room()
    room.add_camera(tools.look_at((2.0, 0.0, 0.3)))
    room.add_camera(tools.look_at((1.5, 1.3, 0.3)), covariance=np.diag(np.repeat([0.01**2, 0.5**2], 3)))
    for j, place in enumerate(((0.0, 0.0, 0.0), (0.1, 0.0, 0.0)), 1):
        room.add_object(j, place, HALF_AXES)
        room.see(1, j)
    room.smoother.update()
    smoother = room.smoother
    with_cross = smoother.difference_covariance(1, 2)
    without = smoother.position_covariance(1) + smoother.position_covariance(2)
    assert np.trace(with_cross) < 0.1 * np.trace(without)
    exact = np.trace(np.diag([0.02, 0.02, 0.05]) ** 2) * 2.0
    assert np.trace(with_cross) == pytest.approx(exact, rel=0.3)


def test_the_mean_of_merged_landmarks_is_that_of_all_their_measurements(two_views, tools):
    """Keyframe 0 saw number 1 and keyframe 1 number 2: one thing, whose measurements count for 1 from then on."""
    room = tools.Room()
    for position in ((2.0, 0.0, 0.3), (1.5, 1.3, 0.3)):
        room.add_camera(tools.look_at(position))
    for j in (1, 2):
        room.add_object(j, (0.1, -0.05, 0.02), HALF_AXES)
        room.see(j - 1, j)
    room.smoother.update()
    room.smoother.merge(1, 2)
    merged = settled(room.smoother)
    alone = settled(two_views((0.1, -0.05, 0.02)).smoother)
    np.testing.assert_allclose(merged.position(1), alone.position(1), atol=1e-4)
    np.testing.assert_allclose(merged.log_size(1), alone.log_size(1), atol=1e-4)
    np.testing.assert_allclose(merged.position_covariance(1), alone.position_covariance(1), rtol=1e-3, atol=1e-9)
    assert_agrees_with_batch(merged, tools)
    assert merged.owner(2) == 1 and 2 not in merged.sites
    with pytest.raises((RuntimeError, IndexError)):
        merged.position(2)


def test_merges_follow_each_other(two_views, tools):
    """2 into 1, then 1 into 3: the measurements of all three count for 3, also those that come later."""
    room = two_views((0.0, 0.0, 0.0), (0.0, 0.01, 0.0), (0.01, 0.0, 0.0))
    smoother = room.smoother
    smoother.merge(1, 2)
    smoother.merge(3, 1)
    assert [smoother.owner(j) for j in (1, 2, 3)] == [3, 3, 3]
    room.see(0, 3)
    assert_agrees_with_batch(settled(smoother), tools)
    assert list(smoother.sites) == [3]
    assert np.trace(smoother.position_covariance(3)) < 0.5 * np.trace(two_views().smoother.position_covariance(1))


def test_a_retired_landmark_leaves_nothing_behind(two_views, tools):
    smoother = two_views((0.0, 0.0, 0.0), (0.3, 0.1, 0.0)).smoother
    smoother.retire(1)
    assert_agrees_with_batch(settled(smoother), tools)
    assert list(smoother.sites) == [2]
    with pytest.raises((RuntimeError, IndexError)):
        smoother.log_size(1)
    assert isinstance(smoother.ledger[len(smoother.ledger) - 1], Retire)


def test_a_landmark_that_leaves_before_it_was_solved_does_no_harm(two_views, tools):
    room = two_views((0.0, 0.0, 0.0))
    for j, leave in ((7, room.smoother.retire), (8, lambda j: room.smoother.merge(1, j))):
        room.add_object(j, (0.0, 0.0, 0.0), HALF_AXES)
        room.see(0, j)
        leave(j)
    assert_agrees_with_batch(settled(room.smoother), tools)


def test_records_of_evidence_touch_no_factor(two_views):
    smoother = two_views().smoother
    before, count = smoother.position(1), len(smoother.ledger)
    smoother.add(Look(0, 1, 1.0, 0.0, 0.5))
    smoother.add(Scores(0, 1, np.array([0.2, 0.7], dtype=np.float32), 0.1, 1.0))
    smoother.settle()
    np.testing.assert_array_equal(smoother.position(1), before)
    assert len(smoother.ledger) == count + 2


def test_an_impossible_measurement_is_refused_and_forgotten(two_views, tools):
    smoother = two_views().smoother
    before = len(smoother.ledger)
    for record in (
        DepthCentre(0, 1, np.full(3, np.nan), 0.1, 0.1, 1.0),
        Box(0, 1, np.array([300.0, 200.0, 300.0, 260.0]), np.ones(4, bool), 2.0),
    ):
        with pytest.raises(ValueError, match="must be"):
            smoother.add(record)
    assert len(smoother.ledger) == before
    Smoother.from_ledger(smoother.ledger, tools.exact, tools.kinect)


def test_the_first_pose_can_be_anywhere(two_views, tools):
    room = two_views()
    np.testing.assert_allclose(room.smoother.poses(), room.cameras, atol=2e-3)
    np.testing.assert_allclose(room.smoother.pose(1), room.smoother.poses()[1], atol=1e-12)
    direction, sigma = room.smoother.up()
    np.testing.assert_allclose(direction, UP, atol=1e-6)
    assert sigma == pytest.approx(0.01, rel=1e-3)
    np.testing.assert_allclose(room.smoother.R_world_upright, np.eye(3), atol=1e-9)
