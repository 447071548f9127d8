"""TUM RGB-D benchmark (Sturm et al. 2012), and recordings in its format.

    rgb.txt  depth.txt           rows `stamp file`, files relative to the folder
    groundtruth.txt              optional, rows `stamp tx ty tz qx qy qz qw`, camera to world
    accelerometer.txt            optional, rows `stamp ax ay az`, the Kinect's own axes
    intrinsics.json | *.yaml     optional, overrides the benchmark's camera (see `read_camera_json`; ORB-SLAM settings)

Depth is stored as 5000 units per metre; 0 means "no reading". The lens distortion of freiburg1 and 2 (a few pixels in
the corners) is not corrected; freiburg3 is free of it. The benchmark's world has z up; of other recordings, gravity is
known where `intrinsics.json` tells it.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from .camera_files import CameraFile, read_camera_json, read_orb_slam_settings
from .errors import InputError
from .frame import Intrinsics
from .images import DepthUnit, FrameFiles, first_image_size
from .poses import MAX_STAMP_DIFFERENCE, read_poses_at
from .recorded import RecordedSequence
from .stamps import associate, read_specific_force
from .tables import read_rows

LAYOUT = "rgb.txt and depth.txt"
UNITS_PER_METRE = 5000.0
Z_UP = np.array([0.0, 0.0, -1.0])  # gravity in the world of the benchmark's motion capture

# Calibrations published with the benchmark, in pixels of the 640 x 480 colour images.
CAMERAS = {
    1: Intrinsics(640, 480, 517.306408, 516.469215, 318.643040, 255.313989),
    2: Intrinsics(640, 480, 520.908620, 521.007327, 325.141442, 249.701764),
    3: Intrinsics(640, 480, 535.4, 539.2, 320.1, 247.6),
}

# The Kinect's accelerometer measures along x left, y up, z forward: half a turn about the camera's z. y and z agree
# with the motion capture at the start of freiburg1_desk (to 5 degrees, all this sensor can do); x follows from the
# right hand.
_CAMERA_FROM_ACCELEROMETER = np.array([-1.0, -1.0, 1.0])


def find_tum(path: Path) -> list[Path]:
    """`path` where it holds `rgb.txt` and `depth.txt`, but not those of keyframes (see `tum_keyframes`)."""
    lists = (path / "rgb.txt").is_file() and (path / "depth.txt").is_file()
    return [path] if lists and not (path / "truth_cam_poses.txt").is_file() else []


def open_tum(path: Path) -> RecordedSequence:
    """Opens one sequence folder.

    Colour and depth are paired one to one, the closest stamps first, at most 0.02 s apart; images without a partner are
    no frames. The stamp of a frame is that of its colour image. Ground truth is interpolated to it (see
    `StampedPoses.at`); a frame in a gap of the motion capture has no pose and is usable.

    Raises:
        InputError: a file is not as above, no images pair, or the camera is unknown.
    """
    color_stamps, color = read_image_list(path / "rgb.txt")
    depth_stamps, depth = read_image_list(path / "depth.txt")
    pairs = associate(color_stamps, depth_stamps, MAX_STAMP_DIFFERENCE)
    if len(pairs) == 0:
        found = f"none among {len(color)} colour and {len(depth)} depth images"
        expected = f"stamps of rgb.txt and depth.txt within {MAX_STAMP_DIFFERENCE} s"
        raise InputError(path, expected, found, "check that both lists are of one recording")
    files = tuple(FrameFiles(Path(color[i]).stem, path / color[i], path / depth[j]) for i, j in pairs)
    stamps = color_stamps[pairs[:, 0]]
    poses = read_poses_at(path / "groundtruth.txt", stamps)
    force = read_specific_force(path / "accelerometer.txt", stamps)
    camera = find_camera(path, files)
    return RecordedSequence(
        path=path,
        name=path.resolve().name,
        files=files,
        intrinsics=camera.intrinsics,
        depth_unit=DepthUnit(camera.depth_scale),
        stamps=stamps,
        poses=poses,
        gravity=None if poses is None else camera.gravity,
        specific_force=None if force is None else force * _CAMERA_FROM_ACCELEROMETER,
    )


def read_image_list(path: Path) -> tuple[np.ndarray, list[str]]:
    """(N,) stamps in seconds and N file names of `rgb.txt` or `depth.txt`.

    Raises:
        InputError: the file is missing, a row is not `stamp file`, or there is no row.
    """
    rows = read_rows(path, "stamp file", "give the folder that holds rgb.txt and depth.txt")
    stamps = np.zeros(len(rows))
    for i, (number, (stamp, _)) in enumerate(rows):
        try:
            stamps[i] = float(stamp)
        except ValueError:
            stamps[i] = np.nan
        if not np.isfinite(stamps[i]):
            found = f"{stamp!r} in line {number}"
            raise InputError(path, "rows of `stamp file`", found, "correct the line, or put # before it")
    if not rows:
        raise InputError(path, "rows of `stamp file`", "no row", "check that the recording is complete")
    return stamps, [name for _, (_, name) in rows]


def find_camera(path: Path, files: tuple[FrameFiles, ...]) -> CameraFile:
    """The camera by a file in the folder, else by the benchmark's folder name; gravity where the world is known.

    Raises:
        InputError: neither tells. The ROS default (525, 525, 319.5, 239.5) is named as a remedy and never assumed:
            it would stretch the map by about 2 % unnoticed.
    """
    match = re.search(r"(?:freiburg|(?<![a-z])fr)([123])(?!\d)", path.resolve().name.lower())
    gravity = Z_UP if match else None
    if (path / "intrinsics.json").is_file():
        camera = read_camera_json(path / "intrinsics.json")
        return camera if camera.gravity is not None else replace(camera, gravity=gravity)
    settings = sorted(path.glob("*.yaml"))
    if len(settings) > 1:
        found = ", ".join(s.name for s in settings)
        raise InputError(path, "one settings file of the camera", found, "keep one, or write intrinsics.json")
    if settings:
        width, height = first_image_size(f.color for f in files) or (640, 480)
        intrinsics, units_per_metre = read_orb_slam_settings(settings[0], width, height)
        return CameraFile(intrinsics, units_per_metre or UNITS_PER_METRE, gravity=gravity)
    if match:
        return CameraFile(CAMERAS[int(match.group(1))], UNITS_PER_METRE, gravity=gravity)
    raise InputError(
        path / "intrinsics.json",
        "the camera's intrinsics, or a folder name with freiburg1, 2 or 3 (fr1, 2 or 3)",
        "neither",
        'write {"width": 640, "height": 480, "fx": 525, "fy": 525, "cx": 319.5, "cy": 239.5, "depth_scale": 5000} '
        "there, with your camera's values (these are the ROS default)",
    )
