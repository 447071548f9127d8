"""`calibration.json` of a folder of LiDAR sweeps: the camera beside the LiDAR, and how the two stand to each other.

    {"width": 1242, "height": 375, "fx": 721, "fy": 721, "cx": 609, "cy": 172,
     "T_camera_lidar": [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]],
     "fps": 10, "splat": [2, 4]}

The last two are optional. `T_camera_lidar` takes points from lidar axes (x forward, y left, z up) to the camera's (x
right, y down, z forward); `splat` is how many pixels a point is spread in the depth image, to each side, and up and
down: about half the gap between two lines of the scanner (`lidar.Splat`).
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .camera_files import check_intrinsics
from .errors import InputError
from .frame import Intrinsics
from .lidar import CAMERA_AXES, NO_CAMERA, Splat
from .poses import nearest_rotations
from .tables import read_text

RATE = 10.0  # Hz, of most scanners
MAX_SPLAT = 40  # px; more would smear the picture
EXAMPLE_JSON = (
    '{"width": 1242, "height": 375, "fx": 721, "fy": 721, "cx": 609, "cy": 172, '
    '"T_camera_lidar": [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]}'
)
_CAMERA_KEYS = ("width", "height", "fx", "fy", "cx", "cy")
_OTHER_KEYS = ("T_camera_lidar", "fps", "splat")


@dataclass(frozen=True, slots=True, eq=False)
class LidarCalibration:
    """A LiDAR and the camera beside it.

    Attributes:
        intrinsics: of the camera, `NO_CAMERA` without one.
        T_camera_lidar: (4, 4); without a file the camera stands where the LiDAR does and looks forward.
        fps: scans per second, for scans without stamps.
        splat: how points become depth images.
    """

    intrinsics: Intrinsics = NO_CAMERA
    T_camera_lidar: np.ndarray = field(default_factory=CAMERA_AXES.copy)
    fps: float = RATE
    splat: Splat = field(default_factory=Splat)


def read_lidar_calibration(path: Path, has_images: bool) -> LidarCalibration:
    """The file as above; without images it may be absent, and what it says of the camera does not matter.

    Raises:
        InputError: the file is missing or no JSON, or a value is missing, unknown or impossible.
    """
    if not path.is_file() and not has_images:
        return LidarCalibration()
    write = f"write it like {EXAMPLE_JSON}"
    text = read_text(path, f"{', '.join(_CAMERA_KEYS)} and T_camera_lidar of the camera", write)
    try:
        values = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(path, "JSON", f"{error.msg} in line {error.lineno}", write) from None
    if not isinstance(values, dict):
        raise InputError(path, "a JSON object", type(values).__name__, write)
    needed = (*_CAMERA_KEYS, "T_camera_lidar") if has_images else ()
    missing = [key for key in needed if key not in values]
    unknown = sorted(set(values) - {*_CAMERA_KEYS, *_OTHER_KEYS})
    if missing or unknown:
        found = f"no {', '.join(missing)}" if missing else f"also {', '.join(unknown)}"
        raise InputError(path, f"the keys {', '.join((*_CAMERA_KEYS, *_OTHER_KEYS))}", found, write)
    intrinsics, T, fps, splat = NO_CAMERA, CAMERA_AXES, RATE, Splat()
    if has_images:
        numbers = _numbers(path, [values[key] for key in _CAMERA_KEYS], (6,), f"positive {', '.join(_CAMERA_KEYS)}")
        intrinsics = Intrinsics(int(numbers[0]), int(numbers[1]), *(float(number) for number in numbers[2:]))
        check_intrinsics(path, intrinsics)
    if "T_camera_lidar" in values:
        form = "a 4x4 rigid transform in T_camera_lidar"
        poses, problems = nearest_rotations(_numbers(path, values["T_camera_lidar"], (4, 4), form)[None])
        if problems:
            raise InputError(path, form, problems[0], "correct the matrix")
        T = poses[0]
    if "fps" in values:
        fps = float(_numbers(path, [values["fps"]], (1,), "a positive fps")[0])
        if fps <= 0:
            raise InputError(path, "a positive fps", f"{fps:g}", "correct the value")
    if "splat" in values:
        width, height = _numbers(path, values["splat"], (2,), "splat as two numbers of pixels")
        if not (0 <= width <= MAX_SPLAT and 0 <= height <= MAX_SPLAT):
            raise InputError(path, f"splat between 0 and {MAX_SPLAT} pixels", f"{width:g}, {height:g}", "correct it")
        splat = Splat(half_width=int(width), half_height=int(height))
    return LidarCalibration(intrinsics, T, fps, splat)


def _numbers(path: Path, values: object, shape: tuple[int, ...], expected: str) -> np.ndarray:
    try:
        numbers = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != shape or not np.isfinite(numbers).all():
        raise InputError(path, expected, repr(values)[:80], "correct the value")
    return numbers
