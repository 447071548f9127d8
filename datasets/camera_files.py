"""Camera files: intrinsics as JSON, as a 3x3 matrix, as an ORB-SLAM settings file; the direction of gravity."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import InputError
from .frame import Intrinsics
from .tables import read_table, read_text

_CAMERA_KEYS = ("width", "height", "fx", "fy", "cx", "cy", "depth_scale")
_OPTIONAL_KEYS = ("fps", "gravity")
EXAMPLE_JSON = '{"width": 640, "height": 480, "fx": 525, "fy": 525, "cx": 319.5, "cy": 239.5, "depth_scale": 1000}'


@dataclass(frozen=True, slots=True, eq=False)
class CameraFile:
    """A camera as a file describes it.

    Attributes:
        intrinsics: of colour and depth.
        depth_scale: value of a depth of one metre in the depth images (1000: millimetres).
        fps: frames per second, for frames without stamps.
        gravity: (3,) unit vector down in the world of the poses, or None.
    """

    intrinsics: Intrinsics
    depth_scale: float
    fps: float = 30.0
    gravity: np.ndarray | None = None


def read_camera_json(path: Path) -> CameraFile:
    """`intrinsics.json`: width, height, fx, fy, cx, cy (pixels), depth_scale (units per metre); optional fps, gravity.

    Raises:
        InputError: the file is missing, is not JSON, or a value is missing, unknown or impossible.
    """
    write = f"write it like {EXAMPLE_JSON}"
    text = read_text(path, "the camera's intrinsics", write)
    try:
        values = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(path, "JSON", f"{error.msg} in line {error.lineno}", write) from None
    if not isinstance(values, dict):
        raise InputError(path, "a JSON object", type(values).__name__, write)
    _check_keys(path, values, write)
    numbers = {key: _positive(path, values, key) for key in (*_CAMERA_KEYS, "fps") if key in values}
    if numbers["depth_scale"] < 1:
        found = f"{numbers['depth_scale']:g}, which looks like metres per unit"
        remedy = f"write {1 / numbers['depth_scale']:g}"
        raise InputError(path, "depth_scale in units per metre (1000 for millimetres)", found, remedy)
    width, height = numbers["width"], numbers["height"]
    if width != int(width) or height != int(height):
        raise InputError(path, "width and height in whole pixels", f"{width:g} x {height:g}", write)
    camera = Intrinsics(int(width), int(height), numbers["fx"], numbers["fy"], numbers["cx"], numbers["cy"])
    check_intrinsics(path, camera)
    gravity = None
    if "gravity" in values:
        gravity = _direction(path, values["gravity"], '"gravity" as [x, y, z]')
    return CameraFile(camera, numbers["depth_scale"], numbers.get("fps", 30.0), gravity)


def read_camera_matrix(path: Path, width: int, height: int) -> Intrinsics:
    """A text file with the 3x3 camera matrix K.

    Raises:
        InputError: the file does not hold such a matrix.
    """
    k = read_table(path, "K1 K2 K3")
    form = "a 3x3 camera matrix fx 0 cx / 0 fy cy / 0 0 1"
    if k.shape != (3, 3):
        raise InputError(path, form, f"{len(k)} rows", "correct the file")
    zeros = k[[0, 1, 2, 2], [1, 0, 0, 1]]
    if not np.isfinite(k).all() or np.abs(zeros).max() > 1e-9 or k[2, 2] != 1:
        raise InputError(path, form, str(k.tolist()), "correct the file; a skew is not supported")
    camera = Intrinsics(width, height, float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2]))
    check_intrinsics(path, camera)
    return camera


def read_orb_slam_settings(path: Path, width: int, height: int) -> tuple[Intrinsics, float | None]:
    """Intrinsics and, where given, units per metre of depth from the settings file of ORB-SLAM2 or 3 (`TUM3.yaml`).

    Only `Camera.fx` ... `Camera.cy` (or `Camera1.`) and the depth factor are read; distortion is not applied.

    Raises:
        InputError: one of the four values is missing or impossible.
    """
    text = read_text(path, "an ORB-SLAM settings file", "check the path")
    values = {key: float(value) for key, value in re.findall(r"^\s*([\w.]+):\s*([-+\d.eE]+)\s*$", text, re.MULTILINE)}
    keys = [(f"Camera.{name}", f"Camera1.{name}") for name in ("fx", "fy", "cx", "cy")]
    missing = [old for old, new in keys if old not in values and new not in values]
    if missing:
        raise InputError(path, "Camera.fx, .fy, .cx and .cy", f"no {', '.join(missing)}", "add the missing values")
    fx, fy, cx, cy = (values[old] if old in values else values[new] for old, new in keys)
    camera = Intrinsics(width, height, fx, fy, cx, cy)
    check_intrinsics(path, camera)
    return camera, values.get("DepthMapFactor", values.get("RGBD.DepthMapFactor"))


def read_gravity(path: Path) -> np.ndarray | None:
    """(3,) unit vector from a file of three numbers, the direction "down"; None where there is no such file.

    Raises:
        InputError: the file holds something else.
    """
    if not path.is_file():
        return None
    try:
        values = [float(field) for field in read_text(path, "three numbers", "check the file").split()]
    except ValueError as error:
        raise InputError(path, "three numbers", str(error), "correct the file") from None
    return _direction(path, values, "three numbers, the direction down")


def check_intrinsics(path: Path, camera: Intrinsics) -> None:
    """Raises:
    InputError: a focal length is not positive, or the principal point lies outside the image.
    """
    if not (camera.fx > 0 and camera.fy > 0):
        raise InputError(path, "positive focal lengths", f"{camera.fx:g} and {camera.fy:g}", "correct fx and fy")
    if not (0 <= camera.cx < camera.width and 0 <= camera.cy < camera.height):
        found = f"({camera.cx:g}, {camera.cy:g}) in {camera.width} x {camera.height} pixels"
        raise InputError(path, "a principal point inside the image", found, "correct cx, cy or the image size")


def _check_keys(path: Path, values: dict[str, object], write: str) -> None:
    missing = [key for key in _CAMERA_KEYS if key not in values]
    if missing:
        raise InputError(path, f"the keys {', '.join(_CAMERA_KEYS)}", f"no {', '.join(missing)}", write)
    unknown = sorted(set(values) - {*_CAMERA_KEYS, *_OPTIONAL_KEYS})
    if unknown:
        # A key that is silently ignored may be a typing error, or distortion that the images still have.
        known = ", ".join((*_CAMERA_KEYS, *_OPTIONAL_KEYS))
        remedy = "remove it (images must be free of distortion and share one camera)"
        raise InputError(path, f"only the keys {known}", f"also {', '.join(unknown)}", remedy)


def _positive(path: Path, values: dict[str, object], key: str) -> float:
    value = values[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value) or value <= 0:
        raise InputError(path, f'a positive number for "{key}"', repr(value), "correct the value")
    return float(value)


def _direction(path: Path, values: object, expected: str) -> np.ndarray:
    try:
        vector = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise InputError(path, expected, repr(values), "give a vector of three numbers that is not zero")
    return vector / np.linalg.norm(vector)
