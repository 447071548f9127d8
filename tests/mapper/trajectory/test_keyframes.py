"""Which frames become keyframes, and frames that follow their keyframes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thingmap.mapper.config import KeyframeConfig
from thingmap.mapper.trajectory.keyframes import FrameTrajectory, KeyframeSelector

CONFIG = KeyframeConfig(translation=0.1, rotation=0.2, max_gap=5)


def pose(x: float = 0.0, turned: float = 0.0) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0.0, turned, 0.0]).as_matrix()
    T[0, 3] = x
    return T


def chosen(poses: list[np.ndarray], config: KeyframeConfig = CONFIG) -> list[int]:
    selector = KeyframeSelector(config)
    return [i for i, T in enumerate(poses) if selector.is_keyframe(T)]


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


@settings(deadline=None, derandomize=True, max_examples=30)
@given(st.integers(0, 1000), st.lists(st.booleans(), min_size=1, max_size=12))
def test_frames_move_with_the_keyframe_before_them(seed, later_keyframes):
    is_keyframe = [True, *later_keyframes]
    T_odometry = random_poses(seed, len(is_keyframe))
    numbers = np.cumsum(is_keyframe) - 1
    trajectory = FrameTrajectory()
    for i, key in enumerate(is_keyframe):
        T_keyframe_camera = trajectory.append(0.1 * i, T_odometry[i], int(numbers[i]), key)
        anchor = T_odometry[np.flatnonzero(is_keyframe)[numbers[i]]]
        np.testing.assert_allclose(anchor @ T_keyframe_camera, T_odometry[i], atol=1e-9)
    assert len(trajectory) == len(is_keyframe)
    # where the graph agrees with odometry, so does the trajectory
    stamps, poses = trajectory.poses(T_odometry[is_keyframe])
    np.testing.assert_allclose(stamps, 0.1 * np.arange(len(is_keyframe)))
    np.testing.assert_allclose(poses, T_odometry, atol=1e-9)
    # where it has moved a keyframe, the frames after it move along, rigidly
    T_graph = random_poses(seed + 1, int(numbers[-1]) + 1)
    _, moved = trajectory.poses(T_graph)
    for i, number in enumerate(numbers):
        first = int(np.flatnonzero(numbers == number)[0])
        np.testing.assert_allclose(moved[first], T_graph[number], atol=1e-9)
        np.testing.assert_allclose(
            np.linalg.inv(moved[first]) @ moved[i], np.linalg.inv(T_odometry[first]) @ T_odometry[i], atol=1e-9
        )


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
