"""Scans as a camera sees them, and sequences of scans."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # `lidar_street` is there

from lidar_street import CAMERA, T_CAMERA_LIDAR, image, pose_at, street, sweep

from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from thingmap.datasets.lidar import CAMERA_AXES, NO_CAMERA, LidarScan, Splat, point_colors, project_scan
from thingmap.datasets.lidar_sequence import LidarSequence, ScanFiles, is_lidar
from thingmap.datasets.sequence import Sequence
from thingmap.datasets.views import subset

SMALL = Intrinsics(40, 30, 30.0, 30.0, 20.0, 15.0)
ONE_PIXEL = Splat(half_width=0, half_height=0)


def scan_at(pixels: list[tuple[int, int]], depths: list[float]) -> LidarScan:
    """Points that project onto these (u, v) of the small camera."""
    points = SMALL.back_project(np.array(pixels, dtype=float), np.array(depths, dtype=float))
    return LidarScan((points @ CAMERA_AXES[:3, :3]).astype(np.float32), CAMERA_AXES)


def wall(columns: range, rows: range, depth: float) -> tuple[list[tuple[int, int]], list[float]]:
    pixels = [(u, v) for u in columns for v in rows]
    return pixels, [depth] * len(pixels)


def test_a_point_straight_ahead_is_in_the_middle_at_its_distance() -> None:
    depth = project_scan(LidarScan(np.array([[7.0, 0, 0]], dtype=np.float32), CAMERA_AXES), SMALL, ONE_PIXEL)
    assert depth.shape == (30, 40) and depth.dtype == np.float32
    assert depth[15, 20] == 7.0 and np.count_nonzero(depth) == 1


def test_left_and_up_of_the_lidar_are_left_and_up_in_the_image() -> None:
    points = np.array([[10.0, 2.0, 0.0], [10.0, 0.0, 2.0]], dtype=np.float32)
    v, u = np.nonzero(project_scan(LidarScan(points, CAMERA_AXES), SMALL, ONE_PIXEL))
    assert sorted(zip(u.tolist(), v.tolist(), strict=True)) == [(14, 15), (20, 9)]


def test_a_point_covers_its_rectangle_and_no_more() -> None:
    depth = project_scan(scan_at([(10, 10), (39, 0)], [5.0, 6.0]), SMALL, Splat(half_width=1, half_height=3))
    np.testing.assert_allclose(depth[7:14, 9:12], 5.0)
    np.testing.assert_allclose(depth[:4, 38:], 6.0)  # cut off by the image's corner
    assert np.count_nonzero(depth) == 7 * 3 + 4 * 2


def test_the_nearest_wins_and_what_is_behind_or_at_the_camera_is_left_out() -> None:
    scan = scan_at([(10, 10), (10, 10), (11, 10), (12, 12), (13, 13)], [8.0, 7.5, 7.6, 0.3, -4.0])
    depth = project_scan(scan, SMALL, Splat(half_width=1, half_height=0))
    np.testing.assert_allclose(depth[10, 9:13], [7.5, 7.5, 7.5, 7.6])
    assert np.count_nonzero(depth) == 4


def test_points_that_shine_through_a_near_surface_are_dropped() -> None:
    # lines of a near wall four pixels apart, and between them what the scanner sees past it
    near, z_near = wall(range(10, 30), range(4, 29, 4), 6.0)
    far, z_far = wall(range(10, 30), range(6, 27, 4), 20.0)
    depth = project_scan(scan_at(near + far, z_near + z_far), SMALL, Splat(half_width=1, half_height=2))
    np.testing.assert_allclose(depth[4:29, 10:30], 6.0)
    spread_only = project_scan(scan_at(far, z_far), SMALL, Splat(half_width=1, half_height=2))
    np.testing.assert_allclose(spread_only[6:27, 10:30], 20.0)  # the same points are kept where nothing is before them


def test_a_ground_that_recedes_keeps_all_its_lines() -> None:
    rows = np.arange(17, 30, 2)
    pixels = [(u, int(v)) for v in rows for u in range(0, 40)]
    depths = [SMALL.fy * 1.7 / (v - 15.0) for v in rows for u in range(0, 40)]  # 25 m down to 3.6 m
    depth = project_scan(scan_at(pixels, depths), SMALL, ONE_PIXEL)
    reached = project_scan(scan_at(pixels, depths), SMALL, Splat(half_width=0, half_height=2))
    np.testing.assert_allclose(depth[rows, 20], [SMALL.fy * 1.7 / (v - 15.0) for v in rows], rtol=1e-6)
    np.testing.assert_allclose(reached[rows[0] - 2, 20], depth[rows[0], 20])  # the farthest line is still there


def test_the_background_beside_a_pole_stays() -> None:
    back, z_back = wall(range(0, 40), range(0, 30, 2), 20.0)
    pole, z_pole = wall(range(19, 22), range(0, 30, 2), 8.0)
    depth = project_scan(scan_at(back + pole, z_back + z_pole), SMALL, Splat(half_width=1, half_height=1))
    np.testing.assert_allclose(depth[:, :18], 20.0)
    np.testing.assert_allclose(depth[:, 23:], 20.0)
    np.testing.assert_allclose(depth[:, 18:23], 8.0)


def test_without_a_camera_there_is_no_depth_image() -> None:
    assert project_scan(LidarScan(np.ones((5, 3), dtype=np.float32), CAMERA_AXES), NO_CAMERA).shape == (0, 0)


def test_a_street_is_seen_at_its_true_depth_and_colour() -> None:
    boxes, T = street(), pose_at(100.5)
    points, _ = sweep(100.5, boxes)
    scan = LidarScan(points, T_CAMERA_LIDAR)
    color, true, index = image(T @ np.linalg.inv(T_CAMERA_LIDAR), boxes)
    depth = project_scan(scan, CAMERA)
    read = depth > 0.0
    assert read.mean() > 0.6  # the scanner looks 6 degrees up, the camera 14
    things = [i for i, box in enumerate(boxes) if box.label and np.count_nonzero(index == i) > 200]
    assert len(things) >= 3
    for i in things:
        v, u = np.nonzero(index == i)
        inner = (np.abs(u - np.median(u)) < np.ptp(u) / 4) & (np.abs(v - np.median(v)) < np.ptp(v) / 4)
        error = depth[v[inner], u[inner]] - true[v[inner], u[inner]]
        assert (depth[v[inner], u[inner]] > 0.0).mean() > 0.95
        assert np.median(np.abs(error)) < 0.15 and (np.abs(error) < 1.0).mean() > 0.95
    frame = Frame(0, "0", 0.0, color, depth, CAMERA, scan=scan)
    assert frame.has_image
    colors = point_colors(frame)
    red = (colors == boxes[things[0]].color).all(axis=1)
    world = points[red] @ T[:3, :3].T + T[:3, 3]
    box = boxes[things[0]]
    assert red.sum() > 20 and ((world > box.low - 0.3) & (world < box.high + 0.3)).all(axis=1).mean() > 0.9
    behind = points[:, 0] < 0.0
    assert behind.any() and (colors[behind] == 128).all()


def test_colours_need_a_scan() -> None:
    frame = Frame(0, "x", 0.0, np.zeros((30, 40, 3), np.uint8), np.ones((30, 40), np.float32), SMALL)
    with pytest.raises(ValueError, match="frame x has no scan"):
        point_colors(frame)


# -- sequences


def make(tmp_path: Path, points: list[np.ndarray | None]) -> LidarSequence:
    """Frames of the given points, or broken ones."""

    def read(index: int, files: ScanFiles) -> tuple[np.ndarray, np.ndarray | None]:
        found = points[index]
        if found is None:
            raise BrokenFrame(files.name, FrameProblem.UNREADABLE_SCAN, "no good")
        return found, np.arange(len(found)) * 1e-3

    return LidarSequence(
        path=tmp_path,
        name="made",
        files=tuple(ScanFiles(str(i), tmp_path / f"{i}.bin") for i in range(len(points))),
        read_scan=read,
        intrinsics=NO_CAMERA,
        T_camera_lidar=CAMERA_AXES,
        stamps=np.arange(len(points)) / 10.0,
    )


GOOD = np.arange(12.0).reshape(4, 3) + 1.0


def test_a_frame_without_a_camera_has_points_and_empty_images(tmp_path: Path) -> None:
    sequence = make(tmp_path, [GOOD, GOOD])
    assert isinstance(sequence, Sequence) and is_lidar(sequence) and is_lidar(subset(sequence, 2))
    frame = sequence[-1]
    assert frame.index == 1 and frame.stamp == 0.1 and not frame.has_image
    assert frame.color.shape == (0, 0, 3) and frame.depth.shape == (0, 0)
    assert frame.scan is not None and frame.scan.points.dtype == np.float32
    np.testing.assert_array_equal(frame.scan.points, GOOD)
    np.testing.assert_array_equal(frame.scan.camera_points()[0], [-2.0, -3.0, 1.0])


def test_no_returns_are_left_out_with_their_times(tmp_path: Path) -> None:
    points = np.array([[1.0, 2, 3], [np.nan, 0, 0], [0, 0, 0], [4, 5, 6], [np.inf, 1, 1]])
    scan = make(tmp_path, [points])[0].scan
    assert scan is not None and scan.times is not None
    np.testing.assert_array_equal(scan.points, points[[0, 3]])
    np.testing.assert_allclose(scan.times, [0.0, 0.003])


def test_one_broken_scan_is_a_broken_frame_and_all_of_them_an_error(tmp_path: Path) -> None:
    sequence = make(tmp_path, [GOOD, np.zeros((3, 3)), None])
    with pytest.raises(BrokenFrame, match=r"1: no valid depth \(none of the 3 points of 1.bin is a return\)"):
        sequence[1]
    with pytest.raises(BrokenFrame, match=r"2: unreadable scan \(no good\)"):
        sequence[2]
    with pytest.raises(InputError, match=r"none of the 3 tried: 0: unreadable scan \(no good\); check that"):
        make(tmp_path, [None, None, None])
    with pytest.raises(InputError, match="expected scans, found none"):
        make(tmp_path, [])


def test_a_depth_camera_is_no_lidar() -> None:
    from thingmap.datasets.synthetic.sample import open_sample

    assert not is_lidar(open_sample("tabletop?frames=2&seed=1"))
