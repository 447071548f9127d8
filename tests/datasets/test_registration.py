"""Depth moved into the colour camera: points, who wins a pixel, poses, and edges of real images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.images import read_frame_images
from thingmap.datasets.registration import DepthRegistration
from thingmap.datasets.seven_scenes import KINECT, REGISTRATION, open_seven_scenes

DEPTH = Intrinsics(64, 48, 60.0, 61.0, 31.0, 24.0)
COLOR = Intrinsics(72, 50, 52.0, 51.0, 36.5, 22.0)  # another size, another field of view
PAIR = DepthRegistration(DEPTH, COLOR, (-0.03, 0.005, 0.01))

offsets = st.tuples(*[st.floats(-0.05, 0.05)] * 3)
cameras = st.builds(
    Intrinsics,
    st.integers(20, 60),
    st.integers(20, 60),
    st.floats(25.0, 80.0),
    st.floats(25.0, 80.0),
    st.floats(8.0, 50.0),
    st.floats(8.0, 50.0),
)


def seen(registration: DepthRegistration, column: int, row: int, z: float) -> tuple[np.ndarray, np.ndarray]:
    """(3,) point of a depth pixel in the colour camera, metres, and the (2,) pixel in which that sees it."""
    point = registration.depth.back_project(np.array([[column, row]], float), np.array([z])) + registration.offset
    return point[0], registration.color.project(point)[0]


def image(shape_of: Intrinsics, readings: dict[tuple[int, int], float]) -> np.ndarray:
    depth = np.zeros((shape_of.height, shape_of.width), np.float32)
    for (column, row), z in readings.items():
        depth[row, column] = z
    return depth


@settings(deadline=None, derandomize=True, max_examples=200)
@given(cameras, cameras, offsets, st.integers(0, 59), st.integers(0, 59), st.floats(0.3, 8.0))
def test_a_reading_lands_where_the_colour_camera_sees_its_point(depth, color, offset, column, row, z):
    assume(column < depth.width and row < depth.height)
    registration = DepthRegistration(depth, color, offset)
    z = float(np.float32(z))
    point, pixel = seen(registration, column, row, z)
    assume(np.abs(pixel - np.floor(pixel) - 0.5).min() > 1e-6)  # not between two pixels
    registered = registration.register(image(depth, {(column, row): z}))
    assert registered.shape == (color.height, color.width) and registered.dtype == np.float32
    u, v = np.rint(pixel).astype(int)
    if 0 <= u < color.width and 0 <= v < color.height:
        assert registered[v, u] == pytest.approx(point[2], rel=1e-6)
        registered[v, u] = 0.0
    assert not registered.any()


@settings(deadline=None, derandomize=True, max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_the_nearest_of_all_points_in_a_pixel_wins(seed):
    rng = np.random.default_rng(seed)
    coarse = DepthRegistration(DEPTH, Intrinsics(9, 7, 6.0, 6.0, 4.0, 3.0), (-0.03, 0.005, 0.01))  # many to a pixel
    depth = rng.uniform(0.5, 4.0, (48, 64)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.3] = 0.0
    expected = np.full((7, 9), np.inf)
    for row, column in zip(*np.nonzero(depth), strict=True):
        point, (u, v) = seen(coarse, column, row, float(depth[row, column]))
        u, v = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
        if 0 <= u < 9 and 0 <= v < 7:
            expected[v, u] = min(expected[v, u], point[2])
    expected[np.isinf(expected)] = 0.0
    assert (expected > 0.0).sum() > 30
    np.testing.assert_allclose(coarse.register(depth), expected, rtol=1e-6)


def test_the_nearer_of_two_wins_whichever_comes_first():
    """Parallax brings a near and a far reading into one pixel; once the near one is read first, once last."""
    for sign in (1.0, -1.0):
        pair = DepthRegistration(DEPTH, DEPTH, (sign * 0.1, 0.0, 0.0))  # 6 px at 1 m, 2 px at 3 m
        near, far = (30, 20), (30 + int(sign * 4), 20)
        registered = pair.register(image(DEPTH, {near: 1.0, far: 3.0}))
        assert registered[20, 30 + int(sign * 6)] == pytest.approx(1.0)
        assert np.count_nonzero(registered) == 1


def test_one_camera_sees_what_it_sees():
    depth = np.random.default_rng(0).uniform(0.5, 4.0, (48, 64)).astype(np.float32)
    depth[:4] = 0.0
    np.testing.assert_array_equal(DepthRegistration(DEPTH, DEPTH, (0.0, 0.0, 0.0)).register(depth), depth)


def test_points_behind_the_colour_camera_are_not_seen():
    ahead = DepthRegistration(DEPTH, DEPTH, (0.0, 0.0, -1.0))
    registered = ahead.register(image(DEPTH, {(31, 24): 0.9, (10, 10): 1.0, (50, 40): 0.5}))
    assert not registered.any()
    assert ahead.register(image(DEPTH, {(31, 24): 1.5}))[24, 31] == pytest.approx(0.5)


def test_a_surface_keeps_no_holes_where_the_colour_camera_is_the_coarser():
    """Else the background would shine through near things."""
    registered = REGISTRATION.register(np.full((480, 640), 1.2, np.float32))
    rows, columns = np.nonzero(registered)
    covered = registered[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    assert covered.size > 0.7 * registered.size
    assert (covered > 0.0).all()


@settings(deadline=None, derandomize=True)
@given(offsets, st.integers(0, 1000))
def test_the_pose_of_the_colour_camera_takes_its_points_to_the_same_place(offset, seed):
    registration = DepthRegistration(DEPTH, COLOR, offset)
    p_depth = np.random.default_rng(seed).normal(size=3)
    p_color = p_depth + offset
    T = registration.T_depth_color
    np.testing.assert_allclose(T[:3, :3] @ p_color + T[:3, 3], p_depth, atol=1e-12)


# -- real images


def distance_to_edges(color: np.ndarray) -> np.ndarray:
    """(H, W) pixels from each pixel to the next image edge, at most 20."""
    grey = cv2.GaussianBlur(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), (0, 0), 1.0)
    away = cv2.distanceTransform((cv2.Canny(grey, 40, 100) == 0).astype(np.uint8), cv2.DIST_L2, 5)
    return np.minimum(away, 20.0)


def outlines(depth: np.ndarray) -> np.ndarray:
    """(H, W) bool: the near side of a jump of 8 % of the depth, up to 3 m."""
    behind = cv2.dilate(depth, np.ones((3, 3), np.uint8))
    return (depth > 0.0) & (depth < 3.0) & (behind - depth > 0.08 * depth)


def test_depth_edges_meet_image_edges_after_registration(real_data: Path):
    sequence = open_seven_scenes(real_data / "redkitchen")
    x, y, z = REGISTRATION.offset
    mirrored = DepthRegistration(REGISTRATION.depth, REGISTRATION.color, (-x, -y, -z))
    for i in (0, 150, 240, 330, 450, 560):
        color, recorded = read_frame_images(sequence.files[i], sequence.depth_unit, sequence.intrinsics)
        away = distance_to_edges(color)
        before, wrong, after = (
            float(np.mean(away[outlines(d)])) for d in (recorded, mirrored.register(recorded), sequence[i].depth)
        )
        assert after < 0.75 * before
        assert after < 0.9 * wrong


def test_two_real_frames_agree_from_the_colour_camera_s_poses(real_data: Path):
    """Points of one registered frame, carried by the poses, lie on the other's depth."""
    sequence = open_seven_scenes(real_data / "redkitchen")
    assert sequence.registration is not None and sequence.intrinsics == REGISTRATION.color != KINECT
    for i, j in ((0, 25), (400, 430)):
        a, b = sequence[i], sequence[j]
        assert a.T_world_camera is not None and b.T_world_camera is not None
        v, u = np.nonzero((a.depth > 0.5) & (a.depth < 3.0))
        points = a.intrinsics.back_project(np.stack([u, v], axis=1)[::7], a.depth[v, u][::7].astype(float))
        T_b_a = np.linalg.inv(b.T_world_camera) @ a.T_world_camera
        points = points @ T_b_a[:3, :3].T + T_b_a[:3, 3]
        uv = np.rint(b.intrinsics.project(points)).astype(int)
        inside = (uv >= 0).all(axis=1) & (uv < [640, 480]).all(axis=1) & (points[:, 2] > 0.3)
        there = b.depth[uv[inside, 1], uv[inside, 0]]
        difference = np.abs(there - points[inside, 2])[there > 0.0]
        assert len(difference) > 5000
        assert np.median(difference) < 0.012
