"""A folder of LiDAR sweeps: the form for your own recordings.

    NAME.pcd or NAME.ply   points x y z in metres, lidar axes (x forward, y left, z up); optional a field of each
                           point's time: `time` (seconds), `t` (nanoseconds where it is whole), `timestamp` (seconds)
    images/NAME.png, .jpg  optional, 8-bit, free of distortion
    calibration.json       of the camera and the LiDAR (see `lidar_calibration`); needed with images
    poses.txt              optional poses of the LiDAR in the world: rows `stamp tx ty tz qx qy qz qw`, or of 12 numbers
                           (3x4, row by row), one a scan

Scans are in natural order (2 before 10). Where every NAME is a number with a decimal point it is the stamp in seconds,
else scan i is at i / fps. Times of points are seconds after the scan's stamp; where they are by another clock (any
beyond one second), the first of the sweep is taken to be at the stamp.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from .errors import InputError
from .frame import BrokenFrame, FrameProblem
from .kitti import POSE_COLUMNS
from .lidar_calibration import read_lidar_calibration
from .lidar_sequence import LidarSequence, RawScan, ScanFiles
from .pcd import BadPcd, read_pcd
from .poses import nearest_rotations, read_poses_at, read_tum_pose_rows
from .recorded import natural_key
from .tables import read_table, read_text

LAYOUT = "*.pcd, or nothing but *.ply (and images/, calibration.json, poses.txt)"
MAX_SWEEP = 1.0  # s; a sweep takes 0.05 to 0.1 s

_BESIDE = {"images", "calibration.json", "poses.txt", "detections.json"}
_STAMP = re.compile(r"\d+\.\d+")
_IMAGES = (".png", ".jpg", ".jpeg")


def find_pcd_folder(path: Path) -> list[Path]:
    """`path` where it holds *.pcd; *.ply only where there is nothing else, since many folders hold a model as well."""
    entries = [entry.name for entry in path.iterdir() if not entry.name.startswith(".")]
    kinds = {Path(name).suffix.lower() for name in entries if name not in _BESIDE}
    return [path] if ".pcd" in kinds or kinds == {".ply"} else []


def open_pcd_folder(path: Path) -> LidarSequence:
    """Opens the folder; a scan without its image is broken.

    Raises:
        InputError: a part is missing or is not as above; it says which and what to do.
    """
    scans = _by_stem(path, (".pcd",)) or _by_stem(path, (".ply",))
    stamped = all(_STAMP.fullmatch(name) for name in scans)
    order = sorted(scans, key=float) if stamped else sorted(scans, key=natural_key)
    has_images = (path / "images").is_dir()
    calibration = read_lidar_calibration(path / "calibration.json", has_images)
    images = _by_stem(path / "images", _IMAGES) if has_images else {}
    stamps = np.array([float(name) for name in order]) if stamped else np.arange(len(order)) / calibration.fps
    poses = _poses(path / "poses.txt", stamps, stamped)
    return LidarSequence(
        path=path,
        name=path.resolve().name,
        files=tuple(
            ScanFiles(name, scans[name], images.get(name, path / "images" / f"{name}.png") if has_images else None)
            for name in order
        ),
        read_scan=_read_scan,
        intrinsics=calibration.intrinsics,
        T_camera_lidar=calibration.T_camera_lidar,
        stamps=stamps,
        poses=None if poses is None else poses @ np.linalg.inv(calibration.T_camera_lidar),
        splat=calibration.splat,
    )


def _by_stem(folder: Path, suffixes: tuple[str, ...]) -> dict[str, Path]:
    files: dict[str, Path] = {}
    for file in sorted(folder.iterdir()):
        if file.suffix.lower() not in suffixes or file.name.startswith("."):
            continue
        if file.stem in files:
            found = f"{files[file.stem].name} and {file.name}"
            raise InputError(folder, "one file for each name", found, "remove one of the two")
        files[file.stem] = file
    return files


def _read_scan(index: int, files: ScanFiles) -> RawScan:
    path = files.scan
    try:
        fields = read_pcd(path) if path.suffix.lower() == ".pcd" else _read_ply(path)
        missing = [axis for axis in "xyz" if axis not in fields]
        if missing:
            raise BadPcd(f"no field {', '.join(missing)}")
        return np.stack([fields[axis] for axis in "xyz"], axis=1), _times(fields)
    except BadPcd as error:
        raise BrokenFrame(files.name, FrameProblem.UNREADABLE_SCAN, f"{path.name}: {error}") from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise BrokenFrame(files.name, FrameProblem.UNREADABLE_SCAN, f"{path.name}: {reason}") from None


def _read_ply(path: Path) -> dict[str, np.ndarray]:
    from plyfile import PlyData, PlyHeaderParseError, PlyParseError

    try:
        vertices = PlyData.read(str(path))["vertex"]
        return {p.name: np.asarray(vertices[p.name]) for p in vertices.properties}
    except (PlyParseError, PlyHeaderParseError, KeyError, ValueError, EOFError) as error:
        raise BadPcd(f"not a PLY file of vertices ({error})") from None


def _times(fields: dict[str, np.ndarray]) -> np.ndarray | None:
    """(N,) seconds after the stamp."""
    name = next((name for name in ("time", "t", "timestamp") if name in fields), None)
    if name is None or len(fields[name]) == 0:
        return None
    values = fields[name]
    whole = name == "t" and np.issubdtype(values.dtype, np.integer)
    times = values.astype(np.float64) * 1e-9 if whole else values.astype(np.float64)
    if not np.isfinite(times).all():
        raise BadPcd(f"field {name} holds what is no time")
    if np.abs(times).max() > MAX_SWEEP:
        times = times - times.min()
    if times.max() > MAX_SWEEP:
        raise BadPcd(f"field {name} spans {times.max():.3g} s; a sweep takes at most {MAX_SWEEP:g} s")
    return times


def _poses(path: Path, stamps: np.ndarray, stamped: bool) -> np.ndarray | None:
    """(N, 4, 4) T_world_lidar, NaN where a scan has none; None without the file."""
    if not path.is_file():
        return None
    rows = [line.split() for line in read_text(path, "poses", "check the file").splitlines()]
    first = next((row for row in rows if row and not row[0].startswith("#")), [])
    if len(first) == 12:
        table = read_table(path, POSE_COLUMNS)
        poses = np.tile(np.eye(4), (len(table), 1, 1))
        poses[:, :3] = table.reshape(-1, 3, 4)
        poses, _ = nearest_rotations(poses)
    elif stamped:
        return read_poses_at(path, stamps)
    else:
        _, poses = read_tum_pose_rows(path)
    if len(poses) != len(stamps):
        remedy = "give a row for each scan (nan for an unknown pose), or name the scans by their stamps in seconds"
        raise InputError(path, f"{len(stamps)} rows, one a scan", f"{len(poses)} rows", remedy)
    return poses
