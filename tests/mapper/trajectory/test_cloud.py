"""The coloured cloud: one point a voxel, anchored to keyframes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.mapper.config import CloudConfig
from thingmap.mapper.trajectory.cloud import KeyframeCloud, voxel_keys

CONFIG = CloudConfig(voxel_size=0.02, pixel_step=1, max_range=4.0)
CAMERA = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
HERE = np.eye(4)[None]


def make_frame(depth: np.ndarray | float, seed: int = 0) -> Frame:
    rng = np.random.default_rng(seed)
    color = rng.integers(0, 256, (48, 64, 3), dtype=np.uint8)
    return Frame(0, "f", 0.0, color, np.broadcast_to(np.float32(depth), (48, 64)).astype(np.float32), CAMERA)


def rough(seed: int) -> np.ndarray:
    """(48, 64) depth of a bumpy surface, metres."""
    return 1.0 + 0.3 * np.random.default_rng(seed).random((48, 64))


def pose(seed: int, move: float = 1.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3] = Rotation.random(rng=rng).as_matrix()
    T[:3, 3] = move * rng.normal(size=3)
    return T


def all_points(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) camera-frame points and (N, 3) colours of all pixels."""
    v, u = np.mgrid[0:48, 0:64]
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    return CAMERA.back_project(uv, frame.depth.ravel().astype(float)), frame.color.reshape(-1, 3)


def cells(points: np.ndarray) -> list[tuple[int, ...]]:
    return [tuple(c) for c in np.floor(points / CONFIG.voxel_size).astype(int).tolist()]


whole = st.integers(-(2**20), 2**20 - 1)


@settings(deadline=None, derandomize=True)
@given(st.lists(st.tuples(whole, whole, whole), min_size=1, max_size=50))
def test_two_points_share_a_key_only_in_the_same_voxel(corners):
    points = (np.array(corners) + 0.5) * 0.02
    keys = voxel_keys(points, 0.02)
    assert keys.dtype == np.int64 and (keys >= 0).all()  # -1 stands for an empty slot
    same_cell = np.all(points[:, None] == points[None], axis=2)
    np.testing.assert_array_equal(keys[:, None] == keys[None], same_cell)


def test_voxels_do_not_change_their_width_at_the_origin():
    x = np.array([-0.021, -0.019, -0.001, 0.001, 0.019, 0.021])
    keys = voxel_keys(np.c_[x, np.zeros(6), np.zeros(6)], 0.02)
    assert len(set(keys.tolist())) == 4
    assert keys[1] == keys[2] and keys[3] == keys[4] and keys[2] != keys[3]


@pytest.mark.parametrize("seed", range(4))
def test_one_point_a_voxel_and_every_voxel_has_one(seed):
    frame, T = make_frame(rough(seed), seed), pose(seed)
    cloud = KeyframeCloud(CONFIG)
    cloud.add(frame, 0, T)
    points, colors = cloud.assemble(T[None])
    assert points.dtype == np.float32 and colors.dtype == np.uint8 and points.shape == colors.shape
    camera, rgb = all_points(frame)
    world = camera @ T[:3, :3].T + T[:3, 3]
    assert len(points) == len(set(cells(world)))
    # every point is one of the image's, with its colour, the first in its voxel
    first: dict[tuple[int, ...], int] = {}
    for i, cell in enumerate(cells(world)):
        first.setdefault(cell, i)
    kept = sorted(first.values())
    np.testing.assert_allclose(points, world[kept], atol=1e-5)
    np.testing.assert_array_equal(colors, rgb[kept])


def test_the_same_place_seen_again_adds_nothing_but_a_new_place_does():
    cloud, frame = KeyframeCloud(CONFIG), make_frame(rough(1))
    cloud.add(frame, 0, np.eye(4))
    count, table = len(cloud.assemble(HERE)[0]), len(cloud._table)
    for keyframe in range(1, 200):
        cloud.add(frame, keyframe, np.eye(4))
    assert len(cloud.assemble(np.tile(np.eye(4), (200, 1, 1)))[0]) == count
    assert len(cloud._table) == table
    aside = np.eye(4)
    aside[0, 3] = 10.0
    cloud.add(frame, 200, aside)
    assert len(cloud.assemble(np.tile(np.eye(4), (201, 1, 1)))[0]) == pytest.approx(2 * count, rel=0.05)


def test_many_places_outgrow_the_first_table_without_losing_or_doubling_a_voxel():
    cloud, seen = KeyframeCloud(CONFIG), set()
    poses = np.tile(np.eye(4), (40, 1, 1))
    poses[:, 0, 3] = 0.9 * np.arange(40)  # neighbours overlap
    before = len(cloud._table)
    for keyframe, T in enumerate(poses):
        frame = make_frame(rough(keyframe))
        cloud.add(frame, keyframe, T)
        seen |= set(cells(all_points(frame)[0] + T[:3, 3]))
    assert len(cloud._table) > before
    assert 2 * len(seen) <= len(cloud._table)
    assert len(cloud.assemble(poses)[0]) == len(seen)


def test_points_move_with_their_keyframe():
    cloud = KeyframeCloud(CONFIG)
    far = np.eye(4)
    far[0, 3] = 50.0
    cloud.add(make_frame(rough(2)), 0, np.eye(4))
    cloud.add(make_frame(rough(3)), 2, far)
    first = len(cloud.assemble(np.stack([np.eye(4)] * 3))[0]) - len(cloud._points[1])
    before, _ = cloud.assemble(np.stack([np.eye(4), pose(8), far]))
    T = pose(5)
    after, _ = cloud.assemble(np.stack([np.eye(4), pose(9), T @ far]))
    np.testing.assert_array_equal(after[:first], before[:first])
    np.testing.assert_allclose(after[first:], before[first:] @ T[:3, :3].T + T[:3, 3], atol=1e-4)


def test_only_depth_in_range_at_the_chosen_pixels_counts():
    depth = np.zeros((48, 64))
    depth[10, 20], depth[11, 20], depth[10, 22], depth[12, 20] = 1.0, 1.5, 4.2, np.nan
    cloud = KeyframeCloud(replace(CONFIG, pixel_step=2))
    frame = make_frame(depth)
    cloud.add(frame, 0, np.eye(4))
    points, colors = cloud.assemble(HERE)
    np.testing.assert_allclose(points, CAMERA.back_project(np.array([[20, 10]]), np.array([1.0])), rtol=1e-6)
    np.testing.assert_array_equal(colors, frame.color[None, 10, 20])


def test_an_empty_cloud():
    for cloud in (KeyframeCloud(CONFIG), KeyframeCloud(CONFIG)):
        points, colors = cloud.assemble(np.empty((0, 4, 4)))
        assert points.shape == colors.shape == (0, 3)
        cloud.add(make_frame(0.0), 0, np.eye(4))
        points, colors = cloud.assemble(HERE)
        assert points.shape == colors.shape == (0, 3)


def seen_twice(T_wrong: np.ndarray) -> tuple[KeyframeCloud, np.ndarray]:
    """Two images of one bumpy surface from one true pose, the second with a wrong one; and the true poses."""
    cloud = KeyframeCloud(CONFIG)
    cloud.add(make_frame(rough(4), 4), 0, np.eye(4))
    cloud.add(make_frame(rough(4), 5), 1, T_wrong)
    return cloud, np.tile(np.eye(4), (2, 1, 1))


def jump() -> np.ndarray:
    """30 cm and 10 degrees."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec([0.0, np.radians(10.0), 0.0]).as_matrix(), [0.3, 0.0, 0.0]
    return T


def test_a_surface_that_was_seen_twice_is_there_once_after_the_correction():
    cloud, true = seen_twice(jump())
    once = KeyframeCloud(CONFIG)
    once.add(make_frame(rough(4), 4), 0, np.eye(4))
    assert len(cloud.assemble(true)[0]) > 1.5 * len(once.assemble(true)[0])
    cloud.rebuild(true)
    for found, expected in zip(cloud.assemble(true), once.assemble(true), strict=True):
        np.testing.assert_array_equal(found, expected)  # the older image's points and colours


def test_after_a_correction_known_places_refuse_points_and_the_wrong_ones_take_them():
    cloud, true = seen_twice(jump())
    cloud.rebuild(true)
    count = len(cloud.assemble(true)[0])
    poses = np.concatenate([true, true[:1], jump()[None]])
    cloud.add(make_frame(rough(4), 6), 2, poses[2])
    assert len(cloud.assemble(poses)[0]) == count
    cloud.add(make_frame(rough(4), 7), 3, poses[3])
    points, _ = cloud.assemble(poses)
    assert len(points) > 1.5 * count and len(points) == cloud._count


@pytest.mark.parametrize("seed", range(3))
def test_a_rebuilt_cloud_has_one_point_a_voxel_wherever_the_poses_went(seed):
    cloud = KeyframeCloud(CONFIG)
    for keyframe in range(6):
        cloud.add(make_frame(rough(keyframe), keyframe), keyframe, pose(10 * seed + keyframe, 0.1))
    moved = np.array([pose(100 + 10 * seed + keyframe, 0.1) for keyframe in range(6)])
    occupied = set(cells(cloud.assemble(moved)[0].astype(float)))
    cloud.rebuild(moved)
    points, colors = cloud.assemble(moved)
    assert len(points) == len(colors) == cloud._count
    assert len(points) == pytest.approx(len(occupied), abs=5)  # float32 points may lie on the other side of a border
    cloud.rebuild(moved)
    for found, expected in zip(cloud.assemble(moved), (points, colors), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_an_empty_cloud_can_be_rebuilt():
    cloud = KeyframeCloud(CONFIG)
    cloud.rebuild(HERE)
    assert cloud.assemble(HERE)[0].shape == (0, 3)
