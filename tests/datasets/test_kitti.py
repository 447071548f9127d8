"""The KITTI layouts, written from a street whose truth is known."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # `lidar_street` is there

import lidar_street as world

from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import BrokenFrame
from thingmap.datasets.lidar_sequence import LidarSequence
from thingmap.datasets.open import open_sequence

FRAMES = 3
BOXES = world.street()


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Root of an odometry benchmark with one sequence; treat as read-only."""
    root = tmp_path_factory.mktemp("kitti")
    world.write_kitti(root, FRAMES, BOXES)
    return root


@pytest.fixture
def copy(written: Path, tmp_path: Path) -> Path:
    """Its sequence's folder, to be damaged."""
    shutil.copytree(written, tmp_path / "kitti")
    return tmp_path / "kitti" / "sequences" / "07"


def opened(path: Path) -> LidarSequence:
    sequence = open_sequence(path)
    assert isinstance(sequence, LidarSequence)
    return sequence


def test_a_sequence_comes_back_as_it_was_written(written: Path) -> None:
    sequence = opened(written)  # found below `sequences`
    assert sequence.name == "kitti-07" and sequence.names == ("000000", "000001", "000002")
    assert sequence.intrinsics == world.CAMERA
    stamps, _ = world.drive(FRAMES)
    np.testing.assert_allclose(sequence.stamps, stamps, atol=1e-4)
    frame = sequence[1]
    points, _ = world.sweep(stamps[1], BOXES)
    assert frame.scan is not None and frame.scan.times is None
    np.testing.assert_array_equal(frame.scan.points, points)
    np.testing.assert_allclose(frame.scan.T_camera_lidar, world.T_CAMERA_LIDAR, atol=1e-9)


def test_images_and_depth_are_of_camera_2_and_poses_in_camera_0s_world(written: Path) -> None:
    sequence = opened(written / "sequences" / "07")
    _, lidar = world.drive(FRAMES)
    cameras = lidar @ np.linalg.inv(world.T_CAMERA_LIDAR)
    T_world_first = lidar[0] @ np.linalg.inv(world.T_CAMERA0_LIDAR)
    frame = sequence[2]
    color, depth, _ = world.image(cameras[2], BOXES)
    np.testing.assert_array_equal(frame.color, color)
    read = (frame.depth > 0.0) & np.isfinite(depth)
    assert (np.abs(frame.depth[read] - depth[read]) < 0.1 * depth[read]).mean() > 0.85
    np.testing.assert_allclose(T_world_first @ frame.T_world_camera, cameras[2], atol=1e-6)


def test_the_projection_is_p2_tr_x(written: Path) -> None:
    """The rule of the benchmark's read-me, against what the loader made of it."""
    rows = dict(line.split(":") for line in (written / "sequences/07/calib.txt").read_text().splitlines())
    P2, Tr = (np.array(rows[key].split(), dtype=float).reshape(3, 4) for key in ("P2", "Tr"))
    sequence = opened(written)
    scan = sequence[0].scan
    assert scan is not None
    ahead = scan.points[scan.points[:, 0] > 2.0][:50].astype(float)
    homogeneous = P2 @ np.vstack([Tr @ np.c_[ahead, np.ones(len(ahead))].T, np.ones(len(ahead))])
    camera = ahead @ scan.T_camera_lidar[:3, :3].T + scan.T_camera_lidar[:3, 3]
    np.testing.assert_allclose(sequence.intrinsics.project(camera).T, homogeneous[:2] / homogeneous[2], atol=1e-6)


def test_without_images_there_are_scans_in_camera_0s_axes(copy: Path) -> None:
    shutil.rmtree(copy / "image_2")
    (copy / "times.txt").unlink()
    (copy.parents[1] / "poses" / "07.txt").rename(copy / "poses.txt")
    sequence = opened(copy)
    frame = sequence[2]
    assert not frame.has_image and frame.scan is not None
    np.testing.assert_allclose(frame.scan.T_camera_lidar, world.T_CAMERA0_LIDAR, atol=1e-9)
    np.testing.assert_allclose(sequence.stamps, [0.0, 0.1, 0.2])
    assert sequence.poses is not None
    np.testing.assert_allclose(sequence.poses[0], np.eye(4), atol=1e-9)


def test_grey_images_do_where_there_are_no_others(copy: Path) -> None:
    (copy / "image_2").rename(copy / "image_0")
    frame = opened(copy)[0]
    assert frame.has_image and frame.scan is not None
    np.testing.assert_allclose(frame.scan.T_camera_lidar, world.T_CAMERA0_LIDAR, atol=1e-9)


def test_files_belong_together_by_their_number(copy: Path) -> None:
    (copy / "velodyne" / "000000.bin").unlink()
    sequence = opened(copy)
    assert sequence.names == ("000001", "000002")
    np.testing.assert_allclose(sequence.stamps, world.drive(FRAMES)[0][1:], atol=1e-4)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "000001.bin has 0 bytes"),
        (b"x" * 50, "000001.bin has 50 bytes, which is not 16 for each point"),
        (bytes(64), "none of the 4 points of 000001.bin is a return"),
    ],
)
def test_a_damaged_scan_is_a_broken_frame(copy: Path, content: bytes, reason: str) -> None:
    (copy / "velodyne" / "000001.bin").write_bytes(content)
    with pytest.raises(BrokenFrame, match=reason):
        opened(copy)[1]
    assert opened(copy)[2].scan is not None


def test_a_missing_or_damaged_image_is_a_broken_frame(copy: Path) -> None:
    (copy / "image_2" / "000001.png").unlink()
    (copy / "image_2" / "000002.png").write_bytes(b"no image")
    sequence = opened(copy)
    with pytest.raises(BrokenFrame, match=r"unreadable image \(000001.png is missing\)"):
        sequence[1]
    with pytest.raises(BrokenFrame, match=r"000002.png cannot be decoded"):
        sequence[2]


def _without(key: str):
    def damage(folder: Path) -> None:
        lines = (folder / "calib.txt").read_text().splitlines()
        (folder / "calib.txt").write_text("\n".join(line for line in lines if not line.startswith(f"{key}:")) + "\n")

    return damage


def _with(key: str, values: str):
    def damage(folder: Path) -> None:
        _without(key)(folder)
        with (folder / "calib.txt").open("a") as file:
            file.write(f"{key}: {values}\n")

    return damage


def _shorten(name: str):
    def damage(folder: Path) -> None:
        file = folder / name
        file.write_text("\n".join(file.read_text().splitlines()[:2]) + "\n")

    return damage


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda f: (f / "calib.txt").unlink(), r"calib.txt: expected the calibration, with P2, Tr, found no such file"),
        (_without("Tr"), r"expected a row `Tr:` of 12 numbers, found none"),
        (_with("Tr", "1 2 3"), r"expected 12 numbers in the row `Tr:`, found '1 2 3'"),
        (_with("Tr", "1 " * 12), r"expected a rigid transform in Tr, found the rotation of the pose is off"),
        (_with("P2", "1 2 3 4 5 6 7 8 9 10 11 12"), r"expected a projection fx 0 cx / 0 fy cy / 0 0 1"),
        (_with("P2", "five"), r"12 numbers in the row `P2:`, found 'five'"),
        (_shorten("times.txt"), r"times.txt: expected a row for each of the scans 0 to 2, found 2 rows"),
        (_shorten("../../poses/07.txt"), r"07.txt: expected a row for each of the scans 0 to 2, found 2 rows"),
        (
            lambda f: (f / "velodyne/000001.bin").rename(f / "velodyne/one.bin"),
            r"named by their number .* found one.bin",
        ),
        (
            lambda f: shutil.rmtree(f / "velodyne") or (f / "velodyne").mkdir(),
            r"velodyne: expected scans \*.bin, found none",
        ),
        (
            lambda f: [i.write_bytes(b"") for i in (f / "image_2").iterdir()],
            r"images \*.png, found none that can be read",
        ),
        (
            lambda f: [s.write_bytes(b"1") for s in (f / "velodyne").iterdir()],
            r"none of the 3 tried: 000000: unreadable",
        ),
    ],
)
def test_what_is_wrong_with_a_sequence_is_told(copy: Path, damage, message: str) -> None:
    damage(copy)
    with pytest.raises(InputError, match=message):
        opened(copy)


# -- raw drives


@pytest.fixture
def drive(written: Path, tmp_path: Path) -> Path:
    """The same recording as a raw drive whose camera 0 is turned by 0.1 rad before rectification."""
    source, folder = written / "sequences" / "07", tmp_path / "2011_09_26" / "2011_09_26_drive_0001_sync"
    (folder / "velodyne_points" / "data").mkdir(parents=True)
    (folder / "image_02" / "data").mkdir(parents=True)
    for i in range(FRAMES):
        shutil.copy(source / f"velodyne/{i:06d}.bin", folder / f"velodyne_points/data/{i:010d}.bin")
        shutil.copy(source / f"image_2/{i:06d}.png", folder / f"image_02/data/{i:010d}.png")
    for name, offset in (("timestamps", 0.05), ("timestamps_start", 0.0), ("timestamps_end", 0.1)):
        rows = [f"2011-09-26 13:02:2{i}.{round((0.25 + offset) * 1e9):09d}" for i in range(FRAMES)]
        (folder / f"velodyne_points/{name}.txt").write_text("\n".join(rows) + "\n")
    c, s = np.cos(0.1), np.sin(0.1)
    turned = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    T = world.T_CAMERA0_LIDAR
    R, t = (world.row_text(turned.T @ part) for part in (T[:3, :3], T[:3, 3]))
    lidar = f"calib_time: 15-Mar-2012 11:37:16\nR: {R}\nT: {t}\n"
    (folder.parent / "calib_velo_to_cam.txt").write_text(lidar)
    P = world.row_text(world.CAMERA.matrix @ world.T_CAMERA_CAMERA0[:3])
    cameras = f"corner_dist: 9.950000e-02\nR_rect_00: {world.row_text(turned)}\nP_rect_02: {P}\n"
    (folder.parent / "calib_cam_to_cam.txt").write_text(cameras)
    return folder


def test_a_raw_drive_comes_back_as_it_was_written(drive: Path) -> None:
    sequence = opened(drive.parent)
    assert sequence.name == "2011_09_26_drive_0001_sync" and sequence.poses is None
    np.testing.assert_allclose(np.diff(sequence.stamps), 1.0, atol=1e-6)
    assert sequence.stamps[0] == pytest.approx(1317042140.3, abs=1e-6)
    frame = sequence[0]
    assert frame.has_image and frame.scan is not None and frame.scan.times is not None
    np.testing.assert_allclose(frame.scan.T_camera_lidar, world.T_CAMERA_LIDAR, atol=1e-9)
    assert np.abs(frame.scan.times).max() <= 0.05 + 1e-6
    points, times = frame.scan.points, frame.scan.times
    ahead = np.abs(np.arctan2(points[:, 1], points[:, 0])) < 0.05
    assert np.abs(times[ahead]).max() < 0.002
    left, right = points[:, 1] > 3.0 * np.abs(points[:, 0]), points[:, 1] < -3.0 * np.abs(points[:, 0])
    np.testing.assert_allclose([times[left].mean(), times[right].mean()], [-0.025, 0.025], atol=0.002)


def test_a_raw_drive_without_the_sweeps_stamps_has_no_times(drive: Path) -> None:
    (drive / "velodyne_points" / "timestamps_end.txt").unlink()
    scan = opened(drive)[0].scan
    assert scan is not None and scan.times is None


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (
            lambda f: (f.parent / "calib_velo_to_cam.txt").unlink(),
            r"calib_velo_to_cam.txt: expected the calibration, with R",
        ),
        (
            lambda f: (f / "velodyne_points/timestamps.txt").write_text("2011-09-26 13:02:20\n"),
            r"scans 0 to 2, found 1 rows",
        ),
        (lambda f: (f / "velodyne_points/timestamps.txt").write_text("noon\n" * 3), r"rows of date and time"),
        (
            lambda f: (f / "velodyne_points/timestamps.txt").write_text("\n" * 3),
            r"rows of date and time, found none in line 1",
        ),
    ],
)
def test_what_is_wrong_with_a_drive_is_told(drive: Path, damage, message: str) -> None:
    damage(drive)
    with pytest.raises(InputError, match=message):
        opened(drive)
