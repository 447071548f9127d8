"""small_gicp odometry: the rendered table, walls that leave directions open, being lost, and the same answer twice."""

from __future__ import annotations

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem
from thingmap.mapper.config import GicpConfig, KeyframeConfig, OdometryConfig, OdometrySource
from thingmap.mapper.trajectory.keyframes import KeyframeSelector
from thingmap.mapper.trajectory.odometry.gicp_odometry import GicpOdometry
from thingmap.mapper.trajectory.odometry.odometry import OdometryStep, TrackingOutcome
from thingmap.mapper.trajectory.rigid import inverse, rotation_angle

CONFIG = OdometryConfig(source=OdometrySource.SMALL_GICP)
SMALL = replace(CONFIG, pixel_step=1)  # for the 160 x 120 depth camera
WALL = [((0.0, 0.0, 1.0), 1.5)]
CORNER = [((0.0, 0.0, 1.0), 1.8), ((1.0, 0.0, 0.0), 0.8), ((0.0, 1.0, 0.0), 0.7)]


def moved(x: float = 0.0, y: float = 0.0, z: float = 0.0, turn: float = 0.0) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0.0, turn, 0.0]).as_matrix()
    T[:3, 3] = [x, y, z]
    return T


def off(estimate: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """Angle, rad, and distance, m, between two poses."""
    error = inverse(truth) @ estimate
    return rotation_angle(error[:3, :3]), float(np.linalg.norm(error[:3, 3]))


def track(frames, config: OdometryConfig) -> tuple[list[np.ndarray], list[tuple[Frame, Frame, OdometryStep]]]:
    odometry, selector = GicpOdometry(config), KeyframeSelector(KeyframeConfig())
    poses, steps, last = [], [], None
    for frame in frames:
        poses.append(odometry.register(frame).T_odometry_camera)
        if selector.is_keyframe(poses[-1]):
            step = odometry.keyframe()
            if last is not None:
                assert step is not None
                steps.append((last, frame, step))
            last = frame
    return poses, steps


@pytest.fixture(scope="module")
def tracked(tabletop):
    """Poses of all frames of the rendered table, and the steps between keyframes with the frames at their ends."""
    return track(tabletop, CONFIG)


def test_the_path_over_a_rendered_table_is_the_true_one(tabletop, tracked):
    poses, _ = tracked
    for frame, T in zip(tabletop, poses, strict=True):
        angle, distance = off(T, inverse(tabletop[0].T_world_camera) @ frame.T_world_camera)
        assert angle < np.radians(0.6) and distance < 0.015


def test_steps_are_as_uncertain_as_they_are_wrong(tracked):
    _, steps = tracked
    assert len(steps) >= 3
    squares = []
    for a, b, step in steps:
        np.linalg.cholesky(step.covariance)
        truth = inverse(a.T_world_camera) @ b.T_world_camera
        error = gtsam.Pose3.Logmap(gtsam.Pose3(step.T_a_b).between(gtsam.Pose3(truth)))
        squares.append(error @ np.linalg.solve(step.covariance, error) / 6.0)
    assert 0.01 < np.mean(squares) < 2.0


def test_the_same_frames_give_the_same_path(tabletop):
    one, two = track(tabletop[:8], CONFIG), track(tabletop[:8], CONFIG)
    np.testing.assert_array_equal(one[0], two[0])
    for (_, _, a), (_, _, b) in zip(one[1], two[1], strict=True):
        np.testing.assert_array_equal(a.covariance, b.covariance)


def test_poses_stay_rigid(plane_frame):
    """Each pose is the guess of the next: a rotation a little off would double its error with every frame."""
    odometry = GicpOdometry(SMALL)
    for index in range(60):
        truth = moved(x=0.003 * index, turn=0.002 * index)
        T = odometry.register(plane_frame(CORNER, truth, index)).T_odometry_camera
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
    assert off(T, truth)[1] < 0.01


def test_a_corner_is_good(plane_frame):
    odometry = GicpOdometry(SMALL)
    for index in range(4):
        tracking = odometry.register(plane_frame(CORNER, moved(x=0.01 * index), index))
        if index == 0:
            assert odometry.keyframe() is None
        assert tracking.outcome is TrackingOutcome.GOOD
    step = odometry.keyframe()
    assert step is not None and (np.sqrt(np.diag(step.covariance))[3:] < 0.006).all()
    assert off(step.T_a_b, moved(x=0.03))[1] < 0.005


def test_along_a_bare_wall_the_guess_is_followed_and_the_step_stays_weak(plane_frame):
    odometry = GicpOdometry(SMALL)
    odometry.register(plane_frame(WALL))
    odometry.keyframe()
    for index in range(1, 4):
        frame = plane_frame(WALL, moved(x=0.01 * index, z=0.01 * index), index)
        # the guess is right along the wall, and wrong towards it
        tracking = odometry.register(frame, moved(x=0.01, z=-0.005))
        assert tracking.outcome is TrackingOutcome.DEGENERATE
    x, _, z = tracking.T_odometry_camera[:3, 3]
    assert x == pytest.approx(0.03, abs=0.008) and z == pytest.approx(0.03, abs=0.004)
    step = odometry.keyframe()
    assert step is not None
    sigma = np.sqrt(np.diag(step.covariance))
    assert (sigma[:2] < 0.01).all() and sigma[5] < 0.006  # tilts and distance: known
    assert sigma[2] > 0.03 and (sigma[3:5] > 0.03).all()  # the turn about the normal, and both ways along the wall


def test_a_guess_carries_over_a_motion_too_fast_for_the_last_one(plane_frame):
    fast = moved(x=-0.3, y=-0.2, z=0.1, turn=0.5)
    odometry = GicpOdometry(SMALL)
    odometry.register(plane_frame(CORNER))
    odometry.keyframe()
    tracking = odometry.register(plane_frame(CORNER, fast, 1), fast @ moved(x=0.03, turn=0.02))
    angle, distance = off(tracking.T_odometry_camera, fast)
    assert tracking.outcome is not TrackingOutcome.LOST and angle < 0.01 and distance < 0.02


ELSEWHERE = [((0.0, 0.3, 1.0), 3.0), ((1.0, 0.2, 0.0), -1.1)]


def test_a_view_of_nothing_known_is_lost_and_changes_no_model(plane_frame):
    odometry = GicpOdometry(SMALL)
    for index in range(3):
        odometry.register(plane_frame(CORNER, moved(x=0.01 * index), index))
        odometry.keyframe()
    tracking = odometry.register(plane_frame(ELSEWHERE, index=3))
    assert tracking.outcome is TrackingOutcome.LOST
    angle, distance = off(tracking.T_odometry_camera, moved(x=0.03))
    assert angle < 0.01 and distance < 0.01  # where the motion before leads
    lost = odometry.keyframe()
    back = odometry.register(plane_frame(CORNER, moved(x=0.02), 4))
    assert back.outcome is TrackingOutcome.GOOD and off(back.T_odometry_camera, moved(x=0.02))[1] < 0.005
    found, sure = odometry.keyframe(), None
    odometry.register(plane_frame(CORNER, moved(x=0.02), 5))
    sure = odometry.keyframe()
    assert lost is not None and found is not None and sure is not None
    # neither the step to a guessed pose nor the one away from it is known; the next one is
    for step, floor in ((lost, 0.5), (found, 0.5)):
        assert (np.sqrt(np.diag(step.covariance)) >= floor).all()
    assert (np.sqrt(np.diag(sure.covariance)) < 0.01).all()


def test_after_a_while_lost_a_new_model_begins(plane_frame):
    odometry = GicpOdometry(replace(SMALL, gicp=GicpConfig(lost_frames=3)))
    odometry.register(plane_frame(CORNER))
    odometry.keyframe()
    outcomes, poses = [], []
    for index in range(1, 8):
        tracking = odometry.register(plane_frame(ELSEWHERE, moved(y=0.01 * index), index))
        outcomes.append(tracking.outcome)
        poses.append(tracking.T_odometry_camera)
    assert outcomes[:3] == [TrackingOutcome.LOST] * 3
    assert TrackingOutcome.LOST not in outcomes[3:]
    step = odometry.keyframe()
    assert step is not None and np.sqrt(np.diag(step.covariance)).min() >= 0.5


def test_a_frame_without_depth_is_broken_and_changes_nothing(plane_frame):
    plain, disturbed = GicpOdometry(SMALL), GicpOdometry(SMALL)
    for index in range(4):
        frame = plane_frame(CORNER, moved(x=0.005 * index), index)
        expected = plain.register(frame).T_odometry_camera
        np.testing.assert_array_equal(disturbed.register(frame).T_odometry_camera, expected)
        with pytest.raises(BrokenFrame, match="0 readings in range") as broken:
            disturbed.register(replace(frame, depth=np.zeros_like(frame.depth)))
        assert broken.value.problem is FrameProblem.NO_DEPTH
        one, two = plain.keyframe(), disturbed.keyframe()
    assert one is not None and two is not None
    np.testing.assert_array_equal(one.T_a_b, two.T_a_b)
    np.testing.assert_array_equal(one.covariance, two.covariance)


def test_after_missing_frames_the_last_velocity_goes_on_and_is_less_sure(plane_frame):
    odometry = GicpOdometry(SMALL)
    for index in range(4):
        odometry.register(plane_frame(CORNER, moved(x=0.01 * index), index))
    odometry.register(plane_frame(CORNER, moved(x=0.05), 5))  # twice the time
    first = next(odometry._guesses(plane_frame(CORNER), None))
    assert odometry._pace == pytest.approx(2.0)
    assert first.sigma == pytest.approx([4.0 * sigma for sigma in GicpConfig().guess_sigma])
    odometry.register(plane_frame(CORNER, moved(x=0.06), 6))  # at the usual pace again: half the way of the last time
    assert odometry._expected()[0, 3] == pytest.approx(0.01, abs=0.006)
