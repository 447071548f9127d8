"""A drive of the KITTI raw data (Geiger et al. 2013), synchronised and rectified.

    2011_09_26_drive_0001_sync/velodyne_points/data/0000000000.bin   sweeps, as in `kitti`
    2011_09_26_drive_0001_sync/velodyne_points/timestamps.txt        when the scanner looked forward, and the camera too
    2011_09_26_drive_0001_sync/velodyne_points/timestamps_start.txt, timestamps_end.txt   optional: of each sweep
    2011_09_26_drive_0001_sync/image_02/data/0000000000.png          optional, left colour camera; else image_00, grey
    calib_velo_to_cam.txt, calib_cam_to_cam.txt                      beside the drive's folder, or in it

A point X of a sweep is at P_rect_02 R_rect_00 [R T] X in image 2. The sweeps still hold the vehicle's motion. A point's
time is not recorded: it follows from its direction, with one turn between the two stamps of the sweep. The scanner
looks forward in the middle of it and turns clockwise seen from above, as KISS-ICP's own reader of this data has it,
while the data's read-me says counter-clockwise. Without the two files of stamps the motion is left in. The GPS poses
(`oxts`) are not read.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from .errors import InputError
from .kitti import read_calibration, read_velodyne, rectified_camera, rigid_transform, scan_files
from .lidar_sequence import LidarSequence, RawScan, ScanFiles
from .tables import read_text

LAYOUT = "velodyne_points/data/*.bin, with calib_velo_to_cam.txt and calib_cam_to_cam.txt beside the drive"
CAMERAS = (("image_02", "P_rect_02"), ("image_00", "P_rect_00"))  # folder and projection, the best first


def find_kitti_raw(path: Path) -> list[Path]:
    """`path` where it is a drive, else the drives in it."""
    candidates = [path] if (path / "velodyne_points").is_dir() else sorted(path.glob("*_sync"))
    return [place for place in candidates if (place / "velodyne_points" / "data").is_dir()]


def open_kitti_raw(path: Path) -> LidarSequence:
    """Opens one drive; scans are matched to rows of stamps by the number in their name.

    Raises:
        InputError: a part is missing or is not as above; it says which and what to do.
    """
    velodyne = path / "velodyne_points"
    scans = scan_files(velodyne / "data")
    numbers = np.array([int(scan.stem) for scan in scans])
    folder, key = next(((f, key) for f, key in CAMERAS if (path / f / "data").is_dir()), (None, "P_rect_00"))
    images = None if folder is None else path / folder / "data"
    camera_file, lidar_file = (_beside(path, f"calib_{name}.txt") for name in ("cam_to_cam", "velo_to_cam"))
    values = read_calibration(camera_file, {"R_rect_00": 9, key: 12})
    intrinsics, T_camera_rectified = rectified_camera(camera_file, values[key], images)
    lidar = read_calibration(lidar_file, {"R": 9, "T": 3})
    T_camera0_lidar = rigid_transform(lidar_file, "R and T", np.c_[lidar["R"].reshape(3, 3), lidar["T"]].ravel())
    R_rectified = np.c_[values["R_rect_00"].reshape(3, 3), np.zeros(3)].ravel()
    T_rectified_camera0 = rigid_transform(camera_file, "R_rect_00", R_rectified)
    stamps = _seconds(velodyne / "timestamps.txt", numbers)
    sweeps = None
    if (velodyne / "timestamps_start.txt").is_file() and (velodyne / "timestamps_end.txt").is_file():
        ends = [_seconds(velodyne / f"timestamps_{end}.txt", numbers) - stamps for end in ("start", "end")]
        sweeps = np.stack(ends, axis=1)
    return LidarSequence(
        path=path,
        name=path.resolve().name,
        files=tuple(ScanFiles(s.stem, s, None if images is None else images / f"{s.stem}.png") for s in scans),
        read_scan=partial(_read_scan, sweeps),
        intrinsics=intrinsics,
        T_camera_lidar=T_camera_rectified @ T_rectified_camera0 @ T_camera0_lidar,
        stamps=stamps,
    )


def _beside(path: Path, name: str) -> Path:
    return path / name if (path / name).is_file() else path.resolve().parent / name


def _seconds(path: Path, numbers: np.ndarray) -> np.ndarray:
    """(N,) seconds since 1970 of the rows `2011-09-26 13:02:25.951199337` that the numbers name."""
    lines = read_text(path, "a stamp for each scan", "add the file of this drive").splitlines()
    if len(lines) <= numbers[-1]:
        expected = f"a row for each of the scans 0 to {numbers[-1]}"
        raise InputError(path, expected, f"{len(lines)} rows", "use the file of this drive")
    rows = [lines[n].strip() for n in numbers]
    try:
        stamps = np.array(rows, dtype="datetime64[ns]")
    except ValueError as error:
        raise InputError(path, "rows of date and time", str(error), "correct the row") from None
    if np.isnat(stamps).any():
        row = int(numbers[np.isnat(stamps)][0]) + 1
        raise InputError(path, "rows of date and time", f"none in line {row}", "correct the row")
    return stamps.astype(np.int64) * 1e-9


def _read_scan(sweeps: np.ndarray | None, index: int, files: ScanFiles) -> RawScan:
    points = read_velodyne(files.name, files.scan)
    if sweeps is None:
        return points, None
    turned = 0.5 - np.arctan2(points[:, 1], points[:, 0]).astype(np.float64) / (2.0 * np.pi)  # of the sweep
    start, end = sweeps[index]
    return points, start + turned * (end - start)
