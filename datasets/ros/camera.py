"""CameraInfo messages: the pinhole camera of a sequence, and images without the lens's distortion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..camera_files import check_intrinsics
from ..errors import InputError
from ..frame import Intrinsics

CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
MATTERS = 0.5  # pixels; images that distortion moves by less everywhere are left as they are

_POLYNOMIAL = ("plumb_bob", "rational_polynomial", "")
_FISHEYE = ("equidistant", "fisheye", "kannala_brandt4")


@dataclass(frozen=True, slots=True, eq=False)
class BagCamera:
    """The camera that the frames have.

    Attributes:
        intrinsics: of colour and depth, after `undistort`.
        maps: pixel of the recorded image for each pixel, two (H, W) float32; None where the images stay as they are.
    """

    intrinsics: Intrinsics
    maps: tuple[np.ndarray, np.ndarray] | None = None

    def undistort_color(self, color: np.ndarray) -> np.ndarray:
        """(H, W, 3) uint8 as recorded to the same of the pinhole camera; black where it saw nothing."""
        return color if self.maps is None else cv2.remap(color, *self.maps, cv2.INTER_LINEAR)

    def undistort_depth(self, depth: np.ndarray) -> np.ndarray:
        """(H, W) float32 metres as recorded to the same of the pinhole camera; nothing is averaged across an edge."""
        return depth if self.maps is None else cv2.remap(depth, *self.maps, cv2.INTER_NEAREST)


def info_size(info: Any) -> tuple[int, int]:
    """(width, height) in pixels."""
    return int(info.width), int(info.height)


def read_camera(path: Path, topic: str, info: Any, rectified: bool) -> BagCamera:
    """The camera by a `CameraInfo` message.

    Args:
        path: the bag; for errors.
        topic: that of the message; for errors.
        info: the message, of ROS 1 or 2.
        rectified: the images are free of distortion already (topics `image_rect...`), so that `P` holds instead of `K`.

    Raises:
        InputError: the camera was never calibrated, its image is a part of the calibrated one or binned, the focal
            length or principal point is impossible, or the model of distortion is unknown.
    """
    _check_whole(path, topic, info)
    width, height = info_size(info)
    matrix = _field(info, "p").reshape(3, 4)[:, :3] if rectified else _field(info, "k").reshape(3, 3)
    if not matrix.any():
        remedy = "calibrate the camera, or name the topic of its calibration with info=TOPIC"
        raise InputError(path, f"a calibrated camera in {topic}", "a matrix of zeros", remedy)
    intrinsics = Intrinsics(width, height, *(float(matrix[i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2))))
    check_intrinsics(path, intrinsics)
    distortion = _field(info, "d")
    if rectified or not distortion.any():
        return BagCamera(intrinsics)
    maps = _map_maker(path, topic, str(info.distortion_model))(intrinsics, distortion)
    u, v = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    moved = np.hypot(maps[0] - u, maps[1] - v).max()
    return BagCamera(intrinsics, maps if moved > MATTERS else None)


def _check_whole(path: Path, topic: str, info: Any) -> None:
    """Refuses the image of a part of the sensor, whose K is not that of the pixels."""
    roi = info.roi
    part = (roi.x_offset, roi.y_offset) != (0, 0) or max(info.binning_x, info.binning_y) > 1
    if part:
        found = f"binning {info.binning_x} x {info.binning_y} and a region from ({roi.x_offset}, {roi.y_offset})"
        raise InputError(path, f"whole images in {topic}", found, "record without binning and without a region")


def _map_maker(path: Path, topic: str, model: str) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    if model in _POLYNOMIAL:
        return _polynomial_maps
    if model in _FISHEYE:
        return _fisheye_maps
    expected = f"a distortion model of {topic} among {', '.join(m for m in (*_POLYNOMIAL, *_FISHEYE) if m)}"
    raise InputError(path, expected, repr(model), "rectify the images first (image_proc) and record image_rect_color")


def _polynomial_maps(k: Intrinsics, distortion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    size = (k.width, k.height)
    x, y = cv2.initUndistortRectifyMap(k.matrix, distortion, np.eye(3), k.matrix, size, cv2.CV_32FC1)
    return np.asarray(x), np.asarray(y)


def _fisheye_maps(k: Intrinsics, distortion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    size = (k.width, k.height)
    x, y = cv2.fisheye.initUndistortRectifyMap(k.matrix, distortion[:4], np.eye(3), k.matrix, size, cv2.CV_32FC1)
    return np.asarray(x), np.asarray(y)


def _field(info: Any, name: str) -> np.ndarray:
    """ROS 1 writes K, D, P; ROS 2 k, d, p."""
    value = getattr(info, name, None)
    return np.asarray(getattr(info, name.upper()) if value is None else value, dtype=np.float64)
