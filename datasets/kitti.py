"""The KITTI odometry benchmark (Geiger et al. 2012), and Semantic KITTI, which adds labels to it.

    sequences/NN/velodyne/000000.bin   sweeps: rows of 4 float32, x y z (metres) and reflectance
    sequences/NN/calib.txt             `P0:` ... `P3:` (3x4, rectified projections) and `Tr:` (3x4, lidar to camera 0)
    sequences/NN/times.txt             optional, seconds, one a frame; without it 10 frames a second
    sequences/NN/image_2/000000.png    optional, left colour camera; else image_0, left grey camera
    poses/NN.txt                       optional, rows of 12 numbers (3x4, row by row); or poses.txt in sequences/NN

A point X of a sweep is at P2 Tr X in image 2. The fourth column of P2 is K t, where t takes points from the axes of
camera 0 to those of camera 2: rectified cameras are parallel. Poses are of camera 0, in the world of its first frame.
The sweeps of this benchmark are already free of the vehicle's motion, so that their points have no times of their own.
All of them read 0.205 degrees too low (Deschaud 2018): `odometry.lidar.elevation_offset` of the mapper's configuration
takes that out of the registration; the projection into the images was calibrated with the points as they are.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from .camera_files import check_intrinsics
from .errors import InputError
from .frame import BrokenFrame, FrameProblem, Intrinsics
from .images import first_image_size
from .lidar import NO_CAMERA
from .lidar_sequence import LidarSequence, RawScan, ScanFiles
from .poses import nearest_rotations
from .tables import read_table, read_text

LAYOUT = "velodyne/*.bin and calib.txt"
CAMERAS = (("image_2", "P2"), ("image_0", "P0"))  # folder and projection, the best first
RATE = 10.0  # Hz, the scanner's, for recordings without times.txt
POSE_COLUMNS = " ".join(f"T{row}{column}" for row in range(3) for column in range(4))


def find_kitti(path: Path) -> list[Path]:
    """`path` where it is a sequence, else the sequences in its folder `sequences`."""
    candidates = [path] if (path / "velodyne").is_dir() else sorted((path / "sequences").glob("*"))
    return [place for place in candidates if (place / "velodyne").is_dir()]


def open_kitti(path: Path) -> LidarSequence:
    """Opens one sequence. Rows of times.txt and of the poses belong to scans by the number in the scan's name.

    Raises:
        InputError: a part is missing or is not as above; it says which and what to do.
    """
    scans = scan_files(path / "velodyne")
    numbers = np.array([int(scan.stem) for scan in scans])
    folder, key = next(((f, key) for f, key in CAMERAS if (path / f).is_dir()), (None, "P0"))
    values = read_calibration(path / "calib.txt", {key: 12, "Tr": 12})
    images = None if folder is None else path / folder
    intrinsics, T_camera_rectified = rectified_camera(path / "calib.txt", values[key], images)
    T_rectified_lidar = rigid_transform(path / "calib.txt", "Tr", values["Tr"])
    stamps = numbers / RATE
    if (path / "times.txt").is_file():
        stamps = _rows_of(path / "times.txt", read_table(path / "times.txt", "seconds"), numbers)[:, 0]
    poses = _poses(path, numbers)
    return LidarSequence(
        path=path,
        name=f"kitti-{path.resolve().name}",
        files=tuple(ScanFiles(s.stem, s, None if images is None else images / f"{s.stem}.png") for s in scans),
        read_scan=_read_scan,
        intrinsics=intrinsics,
        T_camera_lidar=T_camera_rectified @ T_rectified_lidar,
        stamps=stamps,
        poses=None if poses is None else poses @ np.linalg.inv(T_camera_rectified),
    )


def scan_files(folder: Path) -> list[Path]:
    """The *.bin files, by number.

    Raises:
        InputError: there is none, or a name is no number.
    """
    scans = sorted(file for file in folder.glob("*.bin") if not file.name.startswith("."))
    if not scans:
        raise InputError(folder, "scans *.bin", "none", "give the folder that holds a whole sequence")
    for scan in scans:
        if not scan.stem.isdecimal():
            raise InputError(folder, "scans named by their number (000000.bin)", scan.name, "rename or remove it")
    return sorted(scans, key=lambda scan: int(scan.stem))


def read_velodyne(name: str, path: Path) -> np.ndarray:
    """(N, 3) float32 metres, lidar axes.

    Raises:
        BrokenFrame: the file of the frame that is called `name` is missing or is no rows of four float32.
    """
    problem = partial(BrokenFrame, name, FrameProblem.UNREADABLE_SCAN)
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = "is missing" if isinstance(error, FileNotFoundError) else f"cannot be read ({error.strerror})"
        raise problem(f"{path.name} {reason}") from None
    if not data or len(data) % 16:
        raise problem(f"{path.name} has {len(data)} bytes, which is not 16 for each point")
    return np.frombuffer(data, dtype="<f4").reshape(-1, 4)[:, :3]


def read_calibration(path: Path, sizes: dict[str, int]) -> dict[str, np.ndarray]:
    """Rows `key: number ...` of a calibration file: of each key asked for, so many numbers; other rows do not matter.

    Raises:
        InputError: the file or a key is missing, or does not have so many numbers.
    """
    text = read_text(path, f"the calibration, with {', '.join(sizes)}", "add the file of this recording")
    rows = dict(line.split(":", 1) for line in text.splitlines() if ":" in line)
    values: dict[str, np.ndarray] = {}
    for key, size in sizes.items():
        if key not in rows:
            raise InputError(path, f"a row `{key}:` of {size} numbers", "none", "use the file of this recording")
        try:
            values[key] = np.array(rows[key].split(), dtype=np.float64)
        except ValueError:
            values[key] = np.empty(0)
        if len(values[key]) != size or not np.isfinite(values[key]).all():
            raise InputError(
                path, f"{size} numbers in the row `{key}:`", repr(rows[key].strip()[:60]), "correct the row"
            )
    return values


def rectified_camera(path: Path, P: np.ndarray, images: Path | None) -> tuple[Intrinsics, np.ndarray]:
    """Intrinsics, and (4, 4) camera 0's rectified axes to this camera's, from (12,) of a projection matrix P = K [I t].

    Args:
        path: file that P is from, for messages.
        P: (12,), row by row.
        images: folder of PNG images that give the size; None where there is no camera, and then neither matters.

    Raises:
        InputError: there is no image that can be read, or P is no such matrix.
    """
    T = np.eye(4)
    if images is None:
        return NO_CAMERA, T
    size = first_image_size(sorted(images.glob("*.png")))
    if size is None:
        raise InputError(images, "images *.png", "none that can be read", "add the images, or remove the folder")
    P = P.reshape(3, 4)
    camera = Intrinsics(*size, float(P[0, 0]), float(P[1, 1]), float(P[0, 2]), float(P[1, 2]))
    if np.abs(P[[0, 1, 2, 2], [1, 0, 0, 1]]).max() > 1e-6 or abs(P[2, 2] - 1.0) > 1e-6:
        raise InputError(path, "a projection fx 0 cx / 0 fy cy / 0 0 1", str(P[:, :3].tolist()), "correct the file")
    check_intrinsics(path, camera)
    T[:3, 3] = np.linalg.solve(camera.matrix, P[:, 3])
    return camera, T


def rigid_transform(path: Path, key: str, values: np.ndarray) -> np.ndarray:
    """(4, 4) from (12,) numbers of a 3x4 matrix, with the nearest rotation.

    Raises:
        InputError: it is no rigid transform.
    """
    T, problems = nearest_rotations(_with_last_row(values.reshape(1, 12)))
    if problems:
        raise InputError(path, f"a rigid transform in {key}", problems[0], "correct the file")
    return T[0]


def _poses(path: Path, numbers: np.ndarray) -> np.ndarray | None:
    """(N, 4, 4) T_world_camera0, NaN where a row is no pose; None where there is no file."""
    places = (path / "poses.txt", path.resolve().parent.parent / "poses" / f"{path.resolve().name}.txt")
    file = next((place for place in places if place.is_file()), None)
    if file is None:
        return None
    rows = _rows_of(file, read_table(file, POSE_COLUMNS), numbers)
    poses, problems = nearest_rotations(_with_last_row(rows))
    if len(problems) == len(poses):
        remedy = "check that the rows are 3x4 matrices, row by row"
        raise InputError(file, "poses", f"none; in the first row {problems[0]}", remedy)
    return poses


def _rows_of(path: Path, table: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    if len(table) <= numbers[-1]:
        remedy = "use the file of this sequence"
        raise InputError(path, f"a row for each of the scans 0 to {numbers[-1]}", f"{len(table)} rows", remedy)
    return table[numbers]


def _with_last_row(rows: np.ndarray) -> np.ndarray:
    """(N, 12) to (N, 4, 4)."""
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = rows.reshape(-1, 3, 4)
    return poses


def _read_scan(index: int, files: ScanFiles) -> RawScan:
    return read_velodyne(files.name, files.scan), None
