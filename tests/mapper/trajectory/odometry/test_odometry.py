"""Camera motion: KISS-ICP against rendered truth and bare walls, and given poses as measurements."""

from __future__ import annotations

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem
from thingmap.mapper.config import KeyframeConfig, OdometryConfig, OdometrySource
from thingmap.mapper.trajectory.depth_points import DepthPoints
from thingmap.mapper.trajectory.keyframes import KeyframeSelector
from thingmap.mapper.trajectory.odometry.given_odometry import PoseOdometry
from thingmap.mapper.trajectory.odometry.kiss_odometry import KissOdometry
from thingmap.mapper.trajectory.odometry.odometry import OdometryStep, fused, widened
from thingmap.mapper.trajectory.odometry.sources import make_odometry
from thingmap.mapper.trajectory.rigid import inverse, rotation_angle

SMALL = OdometryConfig(pixel_step=1, threads=1)  # for the 160 x 120 depth camera
WALL = [((0.0, 0.0, 1.0), 1.5)]
CORNER = [((0.0, 0.0, 1.0), 1.8), ((1.0, 0.0, 0.0), 0.8), ((0.0, 1.0, 0.0), 0.7)]
POSES = OdometryConfig(source=OdometrySource.POSES)


def transform(rotation_vector, translation) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(rotation_vector).as_matrix()
    T[:3, 3] = translation
    return T


def true_motion(a: Frame, b: Frame) -> np.ndarray:
    assert a.T_world_camera is not None and b.T_world_camera is not None
    return np.linalg.inv(a.T_world_camera) @ b.T_world_camera


def tangent(T: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(6,) right tangent [rad, m] from an estimate to the truth."""
    return gtsam.Pose3.Logmap(gtsam.Pose3(T).between(gtsam.Pose3(truth)))


vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@settings(deadline=None, derandomize=True)
@given(vectors, vectors)
def test_inverse_undoes_a_motion(rotation_vector, translation):
    T = transform(rotation_vector, translation)
    np.testing.assert_allclose(inverse(T) @ T, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(T @ inverse(T), np.eye(4), atol=1e-12)


@settings(deadline=None, derandomize=True)
@given(vectors.filter(lambda v: np.linalg.norm(v) > 1e-3), st.floats(0.0, np.pi))
def test_the_angle_of_a_rotation(axis, angle):
    R = Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis)).as_matrix()
    assert rotation_angle(R) == pytest.approx(angle, abs=1e-6)


@pytest.fixture(scope="module")
def tracked(tabletop) -> tuple[list[np.ndarray], list[tuple[Frame, Frame, OdometryStep]]]:
    """Poses of all frames, and the steps between keyframes with the frames at their ends."""
    odometry, selector = KissOdometry(OdometryConfig()), KeyframeSelector(KeyframeConfig())
    poses, steps, last = [], [], None
    for frame in tabletop:
        poses.append(odometry.register(frame).T_odometry_camera)
        if selector.is_keyframe(poses[-1]):
            step = odometry.keyframe()
            assert (step is None) == (last is None)
            if step is not None:
                steps.append((last, frame, step))
            last = frame
    return poses, steps


def test_the_path_over_a_rendered_table_is_close_to_the_true_one(tabletop, tracked):
    poses, _ = tracked
    truth = true_motion(tabletop[0], tabletop[-1])
    error = inverse(truth) @ inverse(poses[0]) @ poses[-1]
    assert np.linalg.norm(truth[:3, 3]) > 0.25
    # a table-top and bare walls: KISS-ICP starts by slipping along them
    assert np.linalg.norm(error[:3, 3]) < 0.05
    assert rotation_angle(error[:3, :3]) < np.radians(3.0)


def test_steps_between_keyframes_are_as_uncertain_as_they_are_wrong(tracked):
    _, steps = tracked
    assert len(steps) >= 3
    squares = []
    for a, b, step in steps:
        np.testing.assert_allclose(step.covariance, step.covariance.T, rtol=1e-9, atol=1e-15)
        np.linalg.cholesky(step.covariance)
        error = tangent(step.T_a_b, true_motion(a, b))
        squares.append(error @ np.linalg.solve(step.covariance, error) / 6.0)
    assert 0.03 < np.median(squares) < 3.0
    assert np.max(squares) < 10.0


def test_a_step_is_the_motion_between_the_registered_poses(tabletop):
    odometry = KissOdometry(OdometryConfig())
    first = odometry.register(tabletop[0]).T_odometry_camera
    assert odometry.keyframe() is None
    for frame in tabletop[1:4]:
        last = odometry.register(frame).T_odometry_camera
    step = odometry.keyframe()
    assert step is not None
    np.testing.assert_allclose(step.T_a_b, inverse(first) @ last, atol=1e-12)


def test_the_same_frames_give_the_same_path_with_any_number_of_threads(tabletop):
    runs = []
    for threads in (1, 2):
        odometry = KissOdometry(OdometryConfig(threads=threads))
        for frame in tabletop[:4]:
            odometry.register(frame)
        odometry.keyframe()
        for frame in tabletop[4:8]:
            pose = odometry.register(frame).T_odometry_camera
        step = odometry.keyframe()
        assert step is not None
        runs.append((pose, step.T_a_b, step.covariance))
    for one, two in zip(*runs, strict=True):
        np.testing.assert_array_equal(one, two)


def keyframe_sigmas(plane_frame, planes) -> np.ndarray:
    """(6,) standard deviations of a step in which the camera slides 30 mm to the right."""
    odometry = KissOdometry(SMALL)
    odometry.register(plane_frame(planes, np.eye(4)))
    odometry.keyframe()
    for index in range(1, 4):
        odometry.register(plane_frame(planes, transform(np.zeros(3), [0.01 * index, 0.0, 0.0]), index))
    step = odometry.keyframe()
    assert step is not None
    return np.sqrt(np.diag(step.covariance))


def test_a_bare_wall_leaves_the_motion_along_it_open(plane_frame):
    sigma = keyframe_sigmas(plane_frame, WALL)
    assert (sigma[:2] < 0.006).all() and sigma[5] < 0.008  # tilts and distance: known
    assert sigma[2] > 0.03 and (sigma[3:5] > 0.03).all()  # the turn about the normal, and both ways along the wall
    assert (keyframe_sigmas(plane_frame, CORNER)[3:] < 0.01).all()


def test_a_frame_without_depth_in_range_is_broken_and_changes_nothing(plane_frame):
    plain, disturbed = KissOdometry(SMALL), KissOdometry(SMALL)
    for index in range(6):
        frame = plane_frame(CORNER, transform([0.0, 0.004 * index, 0.0], [0.005 * index, 0.0, 0.0]), index)
        expected = plain.register(frame).T_odometry_camera
        np.testing.assert_array_equal(disturbed.register(frame).T_odometry_camera, expected)
        for depth in (0.0, 0.2, 9.0, np.nan):
            with pytest.raises(BrokenFrame, match="0 readings in range") as broken:
                disturbed.register(replace(frame, depth=np.full_like(frame.depth, depth)))
            assert broken.value.problem is FrameProblem.NO_DEPTH
        if index in (0, 5):
            one, two = plain.keyframe(), disturbed.keyframe()
    assert one is not None and two is not None
    np.testing.assert_array_equal(one.T_a_b, two.T_a_b)
    np.testing.assert_array_equal(one.covariance, two.covariance)


@pytest.mark.parametrize("step", [1, 3, 4])
def test_points_are_those_of_every_few_pixels(plane_frame, step):
    """Put back into the image they are at its readings; a shifted grid would tilt the whole scene."""
    frame = plane_frame(CORNER)
    points = DepthPoints(step, SMALL.min_range, SMALL.max_range)(frame)
    pixels = frame.intrinsics.project(points)
    column, row = np.rint(pixels).astype(int).T
    np.testing.assert_allclose(pixels, np.stack([column, row], axis=1), atol=1e-6)
    np.testing.assert_allclose(frame.depth[row, column], points[:, 2], rtol=1e-6)
    assert len(points) == pytest.approx(frame.depth.size / step**2, rel=0.05)


def test_readings_out_of_range_are_left_out(plane_frame):
    """A second wall beyond the range that moves with the camera would hold it back."""
    frames = [plane_frame(CORNER, transform(np.zeros(3), [0.0, 0.0, 0.01 * i]), i) for i in range(4)]
    poses = []
    for far in (False, True):
        odometry = KissOdometry(SMALL)
        for frame in frames:
            depth = frame.depth.copy()
            depth[:30] = 5.0 if far else 0.0
            pose = odometry.register(replace(frame, depth=depth)).T_odometry_camera
        poses.append(pose)
    np.testing.assert_array_equal(poses[0], poses[1])


def with_pose(frame: Frame, T: np.ndarray | None) -> Frame:
    return replace(frame, T_world_camera=T)


@settings(deadline=None, derandomize=True, max_examples=50)
@given(vectors, vectors, vectors, vectors)
def test_given_poses_are_measurements_of_the_motion_between_them(plane_frame, rotation_a, a, rotation_b, b):
    frame, odometry = plane_frame(WALL), PoseOdometry(POSES)
    T_a, T_b = transform(rotation_a, a), transform(rotation_b, b)
    np.testing.assert_array_equal(odometry.register(with_pose(frame, T_a)).T_odometry_camera, T_a)
    assert odometry.keyframe() is None
    odometry.register(with_pose(frame, np.eye(4)))  # not a keyframe
    np.testing.assert_array_equal(odometry.register(with_pose(frame, T_b)).T_odometry_camera, T_b)
    step = odometry.keyframe()
    assert step is not None
    np.testing.assert_allclose(T_a @ step.T_a_b, T_b, atol=1e-12)
    variances = np.diag(step.covariance)
    np.testing.assert_array_equal(step.covariance, np.diag(variances))
    assert (np.sqrt(variances) > np.repeat(POSES.pose_sigma, 3)).all()
    moved = np.linalg.norm(step.T_a_b[:3, 3])
    assert (np.sqrt(variances[3:]) >= POSES.drift[1] * moved).all()  # the further, the vaguer


def test_a_missing_pose_breaks_its_frame_and_changes_nothing(plane_frame):
    frame, odometry = plane_frame(WALL), PoseOdometry(POSES)
    odometry.register(with_pose(frame, transform([0.0, 0.1, 0.0], [1.0, 2.0, 3.0])))
    assert odometry.keyframe() is None
    odometry.register(with_pose(frame, transform([0.0, 0.1, 0.0], [1.0, 2.0, 3.5])))
    with pytest.raises(BrokenFrame, match="frame-000000: missing pose") as broken:
        odometry.register(with_pose(frame, None))
    assert broken.value.problem is FrameProblem.MISSING_POSE
    step = odometry.keyframe()
    assert step is not None
    assert np.linalg.norm(step.T_a_b[:3, 3]) == pytest.approx(0.5)


def test_the_configuration_names_the_odometry():
    assert isinstance(make_odometry(POSES), PoseOdometry)
    assert isinstance(make_odometry(OdometryConfig()), KissOdometry)


# -- two measurements of one motion


def spread(rng: np.random.Generator, size: float = 0.02) -> np.ndarray:
    """(6, 6) some covariance."""
    root = size * rng.normal(size=(6, 6))
    return root @ root.T + np.diag(np.full(6, 1e-6))


seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None, derandomize=True, max_examples=50)
@given(seeds, vectors)
def test_the_mean_of_two_motions_lies_between_them(seed, rotation_vector):
    rng = np.random.default_rng(seed)
    T, one, other = transform(rotation_vector, rng.normal(size=3)), spread(rng), spread(rng)
    d = 0.02 * rng.normal(size=6)
    T_other = (gtsam.Pose3(T) * gtsam.Pose3.Expmap(d)).matrix()
    mean, covariance = fused(T, one, T_other, other)
    # the surer one counts for more: d_mean = (one^-1 + other^-1)^-1 other^-1 d
    np.testing.assert_allclose(tangent(T, mean), one @ np.linalg.solve(one + other, d), atol=1e-9)
    np.testing.assert_allclose(covariance, one @ np.linalg.solve(one + other, other), rtol=1e-5, atol=1e-10)
    for each in (one, other):
        assert np.linalg.eigvalsh(each - covariance).min() > -1e-9  # never less sure than either
    swapped, _ = fused(T_other, other, T, one)
    # each in its own tangent: alike but for the second order of d
    assert np.linalg.norm(tangent(mean, swapped)) < 2.0 * np.linalg.norm(d) ** 2


def test_an_open_direction_is_filled_by_the_other_measurement():
    T, T_other = np.eye(4), transform([0.0, 0.0, 0.0], [0.05, 0.0, 0.004])
    wall = np.diag(np.square([0.001, 0.001, 0.1, 0.2, 0.2, 0.001]))
    features = np.diag(np.square(np.repeat([0.003, 0.004], 3)))
    mean, covariance = fused(T, wall, T_other, features)
    assert mean[0, 3] == pytest.approx(0.05, abs=1e-3) and mean[2, 3] == pytest.approx(0.004 / 17.0, rel=1e-3)
    assert np.sqrt(np.diag(covariance)[3:]) == pytest.approx([0.004, 0.004, 0.001], rel=0.05)


@settings(deadline=None, derandomize=True, max_examples=50)
@given(seeds, st.floats(0.1, 20.0))
def test_a_contradicted_motion_is_widened_and_one_that_agrees_is_not(seed, far):
    rng = np.random.default_rng(seed)
    T, own, other, gate = transform(rng.normal(size=3), rng.normal(size=3)), spread(rng), spread(rng, 0.01), 22.46
    d = rng.normal(size=6)
    d *= np.sqrt(far * gate / (d @ np.linalg.solve(own + other, d)))  # `far` times the gate
    T_other = (gtsam.Pose3(T) * gtsam.Pose3.Expmap(d)).matrix()
    if np.linalg.norm(d[:3]) > 3.0:
        return  # more than half a turn is another motion
    result = widened(T, own, T_other, other, gate)
    if far < 0.999:
        np.testing.assert_array_equal(result, own)
    elif far > 1.001:
        assert d @ np.linalg.solve(result + other, d) < 1.0  # it no longer does, and only along what they disagree in
        across = rng.normal(size=6)
        across -= (across @ d) / (d @ d) * d
        assert across @ result @ across == pytest.approx(across @ own @ across, rel=1e-6)


def test_a_surer_motion_that_is_contradicted_follows_the_other():
    """As when a bent local model snaps back: features say that nothing of the kind happened."""
    own, features = np.diag(np.full(6, 0.001**2)), np.diag(np.square(np.repeat([0.003, 0.004], 3)))
    T, T_other = transform([0.0, 0.0, 0.0], [0.08, 0.0, 0.0]), np.eye(4)
    believed = fused(T, own, T_other, features)[0]
    doubted = fused(T, widened(T, own, T_other, features, 22.46), T_other, features)[0]
    assert believed[0, 3] > 0.07 and doubted[0, 3] < 0.02
