"""Which way is up: measurements of the world's up direction in one camera frame."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...datasets.frame import Frame
from ..config import UpConfig

PLANE_STEP = 2  # pixels: planes are looked for at half resolution
NO_PLANE = 255  # cv2.findPlanes' label of pixels on no plane


@dataclass(frozen=True, slots=True, eq=False)
class UpMeasurement:
    """Up in camera axes: (3,) unit vector and the standard deviation of its direction, rad."""

    direction: np.ndarray
    sigma: float
    source: str


def camera_prior(config: UpConfig) -> UpMeasurement:
    """A camera is held roughly upright: up is -y in its image."""
    return UpMeasurement(np.array([0.0, -1.0, 0.0]), config.prior_sigma, "camera prior")


def scanner_prior(frame: Frame, config: UpConfig) -> UpMeasurement | None:
    """A LiDAR stands upright: up is its z axis. None for a depth camera."""
    if frame.scan is None:
        return None
    return UpMeasurement(frame.scan.T_camera_lidar[:3, 2], config.scanner_sigma, "LiDAR axis")


def from_accelerometer(frame: Frame, config: UpConfig) -> UpMeasurement | None:
    """At rest the specific force points up; readings far from 1 g are the hand's and are left out."""
    up = frame.up_at_rest
    return None if up is None else UpMeasurement(up, config.accelerometer_sigma, "accelerometer")


def from_planes(frame: Frame, up_camera: np.ndarray, config: UpConfig) -> UpMeasurement | None:
    """Normal of the supporting planes in view (tables, floor): those within `max_tilt` of the expected up.

    Args:
        frame: the keyframe.
        up_camera: (3,) unit vector, up as currently known, in camera axes.
        config: thresholds.

    Returns:
        The mean of the planes' normals weighted by their pixels, or None where no support is in view.
    """
    points = _organised_points(frame)
    height, width = points.shape[:2]
    normals = cv2.RgbdNormals.create(height, width, cv2.CV_32F, _half_matrix(frame), 5).apply(points)
    labels, planes = cv2.findPlanes(points, normals)
    if planes is None:
        return None
    planes = np.asarray(planes, dtype=np.float64).reshape(-1, 4)
    valid = np.isfinite(points[..., 2])
    counts = np.bincount(labels[valid], minlength=NO_PLANE + 1)[: len(planes)]
    total = np.zeros(3)
    for normal, count in zip(planes[:, :3], counts, strict=True):
        length = np.linalg.norm(normal)
        if length == 0 or count < config.min_plane_share * valid.sum():
            continue
        unit = normal / length
        unit = unit if unit @ up_camera > 0 else -unit
        if unit @ up_camera > np.cos(config.max_tilt):
            # rounded: OpenCV adds in parallel, and the last bits differ from run to run
            total += count * np.round(unit, 6)
    length = np.linalg.norm(total)
    if length == 0:
        return None
    return UpMeasurement(total / length, config.plane_sigma, "planes")


def _half_matrix(frame: Frame) -> np.ndarray:
    matrix = frame.intrinsics.matrix
    matrix[:2] /= PLANE_STEP
    return matrix.astype(np.float32)


def _organised_points(frame: Frame) -> np.ndarray:
    """(H/2, W/2, 4) float32 camera-frame points (the fourth is OpenCV's padding), NaN without reading.

    Depth is smoothed first: normals of raw Kinect depth scatter by tens of degrees.
    """
    depth = cv2.bilateralFilter(frame.depth[::PLANE_STEP, ::PLANE_STEP], 5, 0.03, 2.0)
    k = frame.intrinsics
    v, u = np.mgrid[0 : k.height : PLANE_STEP, 0 : k.width : PLANE_STEP].astype(np.float32)
    z = np.where((depth > 0.3) & (depth < 4.0), depth, np.nan).astype(np.float32)
    return np.stack([(u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z, np.zeros_like(z)], axis=-1)
