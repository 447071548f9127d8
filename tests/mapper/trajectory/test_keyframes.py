"""Which frames become keyframes, and frames that follow their keyframes."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thingmap.mapper.config import KeyframeConfig
from thingmap.mapper.trajectory.keyframes import FrameTrajectory, KeyframeSelector
from thingmap.mapper.trajectory.odometry.odometry import TrackingOutcome
from thingmap.mapper.trajectory.rigid import inverse

CONFIG = KeyframeConfig(translation=0.1, rotation=0.2, max_gap=5)


def pose(x: float = 0.0, turned: float = 0.0) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0.0, turned, 0.0]).as_matrix()
    T[0, 3] = x
    return T


def chosen(poses: list[np.ndarray], config: KeyframeConfig = CONFIG) -> list[int]:
    selector = KeyframeSelector(config)
    return [i for i, T in enumerate(poses) if selector.is_keyframe(T)]


def test_where_every_frame_is_wanted_a_still_camera_has_keyframes_too():
    selector = KeyframeSelector(CONFIG)
    assert [selector.is_keyframe(pose(), every=every) for every in (False, False, True, False)] == [
        True,
        False,
        True,
        False,
    ]


def random_poses(seed: int, count: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3] = Rotation.random(count, rng=rng).as_matrix()
    T[:, :3, 3] = rng.normal(size=(count, 3))
    return T


def test_translation_and_rotation_count_from_the_last_keyframe():
    assert chosen([pose(x) for x in (0.0, 0.06, 0.12, 0.18, 0.24)]) == [0, 2, 4]
    assert chosen([pose(turned=a) for a in (0.0, 0.15, 0.25, 0.4, 0.5)]) == [0, 2, 4]
    assert chosen([pose(), pose(0.09, 0.19), pose(-0.09, -0.19), pose(0.0)]) == [0]


def test_a_still_camera_gets_a_keyframe_every_so_often():
    assert chosen([pose()] * 12) == [0, 5, 10]
    # the gap counts from the last keyframe, whatever made it one
    assert chosen([pose()] * 3 + [pose(1.0)] * 7) == [0, 3, 8]


@settings(deadline=None, derandomize=True, max_examples=30)
@given(st.integers(0, 1000))
def test_the_choice_does_not_depend_on_where_the_odometry_began(seed):
    T_other = random_poses(seed, 1)[0]
    rng = np.random.default_rng(seed)
    walk = [pose(x, a) for x, a in np.cumsum(rng.uniform(-0.08, 0.08, (30, 2)), axis=0)]
    assert chosen(walk) == chosen([T_other @ T for T in walk])


def follow(T_odometry: np.ndarray, is_keyframe: list[bool]) -> FrameTrajectory:
    trajectory, number = FrameTrajectory(), -1
    for i, (T, key) in enumerate(zip(T_odometry, is_keyframe, strict=True)):
        number += key
        trajectory.append(0.1 * i, T, number, key)
    return trajectory


@settings(deadline=None, derandomize=True, max_examples=30)
@given(st.integers(0, 1000), st.lists(st.booleans(), min_size=1, max_size=12))
def test_frames_move_with_their_keyframes(seed, later_keyframes):
    is_keyframe = [True, *later_keyframes]
    T_odometry = random_poses(seed, len(is_keyframe))
    numbers = np.cumsum(is_keyframe) - 1
    trajectory = FrameTrajectory()
    for i, key in enumerate(is_keyframe):
        T_keyframe_camera = trajectory.append(0.1 * i, T_odometry[i], int(numbers[i]), key)
        anchor = T_odometry[np.flatnonzero(is_keyframe)[numbers[i]]]
        np.testing.assert_allclose(anchor @ T_keyframe_camera, T_odometry[i], atol=1e-9)
    assert len(trajectory) == len(is_keyframe)
    np.testing.assert_allclose(trajectory.keyframe_stamps(), 0.1 * np.flatnonzero(is_keyframe))
    # where the graph agrees with odometry, so does the trajectory; as a whole it may lie elsewhere
    T_elsewhere = random_poses(seed + 2, 1)[0]
    stamps, poses = trajectory.poses(T_elsewhere @ T_odometry[is_keyframe])
    np.testing.assert_allclose(stamps, 0.1 * np.arange(len(is_keyframe)))
    np.testing.assert_allclose(poses, T_elsewhere @ T_odometry, atol=1e-9)
    # where it has moved keyframes, those are where it says, and the frames after the last move along with it, rigidly
    T_graph = random_poses(seed + 1, int(numbers[-1]) + 1)
    _, moved = trajectory.poses(T_graph)
    np.testing.assert_allclose(moved[is_keyframe], T_graph, atol=1e-9)
    last = int(np.flatnonzero(is_keyframe)[-1])
    np.testing.assert_allclose(
        inverse(moved[last]) @ moved[last:], inverse(T_odometry[last]) @ T_odometry[last:], atol=1e-9
    )
    np.testing.assert_allclose(moved @ np.array([inverse(T) for T in moved]) - np.eye(4), 0.0, atol=1e-9)


def test_frames_between_keyframes_take_their_share_of_the_correction():
    # odometry says 0.4 m forward, the graph 0.44 m and a turn of 0.2 rad
    trajectory = follow(
        np.array([pose(x) for x in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)]), [True, False, False, False, True, False]
    )
    _, poses = trajectory.poses(np.array([pose(), pose(0.44, 0.2)]))
    turned = Rotation.from_matrix(poses[:, :3, :3]).as_rotvec()[:, 1]
    np.testing.assert_allclose(turned, [0.0, 0.05, 0.1, 0.15, 0.2, 0.2], atol=1e-12)
    np.testing.assert_allclose(poses[:5, 0, 3], [0.0, 0.11, 0.22, 0.33, 0.44], atol=2e-4)
    np.testing.assert_allclose(poses[5], pose(0.44, 0.2) @ pose(0.1), atol=1e-12)


@pytest.mark.parametrize("jump", [random_poses(seed, 1)[0] for seed in range(5)])
def test_a_jump_of_odometry_leaves_frames_between_their_keyframes(jump: np.ndarray):
    jump[:3, 3] *= 0.5 / np.linalg.norm(jump[:3, 3])
    walk = np.array([pose(0.02 * i) for i in range(21)])
    T_odometry = np.concatenate([walk[:10], jump @ walk[10:]])
    _, poses = follow(T_odometry, [True, *[False] * 19, True]).poses(walk[[0, 20]])
    np.testing.assert_allclose(poses[[0, 20]], walk[[0, 20]], atol=1e-9)
    # |V^-1 t| <= pi / 2 |t| for any turn, so nothing is flung away by more than the jump and its lever
    assert np.linalg.norm(poses[:, :3, 3] - walk[:, :3, 3], axis=1).max() < np.pi / 2 * (0.5 + 2 * 0.4) + 0.5


def test_a_long_trajectory_is_quick():
    count = 100_000
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, 0, 3] = 0.01 * np.arange(count)
    is_keyframe = (np.arange(count) % 6 == 0).tolist()
    trajectory = follow(T, is_keyframe)
    start = time.process_time()
    _, poses = trajectory.poses(1.01 * T[is_keyframe] - 0.01 * np.eye(4))
    assert time.process_time() - start < 1.0
    np.testing.assert_allclose(poses[:-6, 0, 3], 1.01 * T[:-6, 0, 3], rtol=1e-9, atol=1e-9)


def outcomes(text: str, config: KeyframeConfig = CONFIG) -> list[int]:
    """Keyframes of a still camera whose frames are G(OOD), D(EGENERATE) or L(OST)."""
    by_letter = {o.name[0]: o for o in TrackingOutcome}
    selector = KeyframeSelector(config)
    return [i for i, letter in enumerate(text) if selector.is_keyframe(pose(), by_letter[letter])]


def test_where_tracking_is_lost_and_found_again_there_are_keyframes():
    rare = KeyframeConfig(translation=0.1, rotation=0.2, max_gap=100, lost_gap=3)
    assert outcomes("GGGLGG", rare) == [0, 3, 4]
    assert outcomes("GGLLLLLLLLGG", rare) == [0, 2, 5, 8, 10]
    assert outcomes("GGDDLDD", rare) == [0, 4, 5]
    assert outcomes("GDGDGD", rare) == [0]
    assert outcomes("LLLLG", rare) == [0, 3, 4]


def test_a_lost_frame_far_from_the_last_keyframe_is_one():
    selector = KeyframeSelector(CONFIG)
    lost = TrackingOutcome.LOST
    assert selector.is_keyframe(pose()) and selector.is_keyframe(pose(), lost)
    assert not selector.is_keyframe(pose(0.05), lost)
    assert selector.is_keyframe(pose(0.2), lost)


def test_no_frame_no_pose():
    stamps, poses = FrameTrajectory().poses(np.empty((0, 4, 4)))
    assert stamps.shape == (0,) and poses.shape == (0, 4, 4)
    assert len(FrameTrajectory()) == 0


@pytest.mark.parametrize("jump", [CONFIG.translation * 1.01, -5.0])
def test_a_keyframe_is_remembered_only_when_it_is_one(jump: float):
    selector = KeyframeSelector(CONFIG)
    assert selector.is_keyframe(pose())
    for _ in range(2):
        assert not selector.is_keyframe(pose(0.9 * CONFIG.translation))
    assert selector.is_keyframe(pose(jump))
    assert not selector.is_keyframe(pose(jump))
