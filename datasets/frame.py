"""One RGB-D image with what is known about its camera."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .lidar import LidarScan


AT_REST = (8.5, 11.5)  # m/s^2, about 1 g: beyond it a reading is the hand's


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Pinhole camera: focal lengths and principal point in pixels, pixel centres at integers."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    @property
    def matrix(self) -> np.ndarray:
        """(3, 3) camera matrix K."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def back_project(self, uv: np.ndarray, z: np.ndarray) -> np.ndarray:
        """(N, 2) pixels and (N,) depths in metres to (N, 3) points in the camera frame, metres."""
        x = (uv[:, 0] - self.cx) * z / self.fx
        y = (uv[:, 1] - self.cy) * z / self.fy
        return np.stack([x, y, z], axis=1)

    def project(self, points: np.ndarray) -> np.ndarray:
        """(N, 3) camera-frame points, metres, z > 0, to (N, 2) pixels."""
        u = self.fx * points[:, 0] / points[:, 2] + self.cx
        v = self.fy * points[:, 1] / points[:, 2] + self.cy
        return np.stack([u, v], axis=1)


class FrameProblem(Enum):
    """Why a frame of a sequence cannot be used."""

    UNREADABLE = "unreadable image"
    UNREADABLE_SCAN = "unreadable scan"
    SIZE_MISMATCH = "image size differs from the sequence's"
    NO_DEPTH = "no valid depth"
    MISSING_POSE = "missing pose"
    OTHER_CAMERA = "intrinsics differ from the first frame's"


class BrokenFrame(Exception):
    """Raised by `Sequence.__getitem__`; the run skips the frame, counts it and names it."""

    def __init__(self, name: str, problem: FrameProblem, detail: str = "") -> None:
        self.name, self.problem, self.detail = name, problem, detail
        super().__init__(f"{name}: {problem.value}" + (f" ({detail})" if detail else ""))


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """An RGB-D image, or a LiDAR's sweep with the image of a camera beside it, where there is one.

    Camera axes are OpenCV's: x right, y down, z forward. Without a camera the images are empty, the intrinsics those of
    an image of no size (`lidar.NO_CAMERA`), and poses are those of the camera axes that `scan.T_camera_lidar` defines.

    Attributes:
        index: position in the sequence.
        name: what the dataset calls it: the stem of the colour file, without a suffix that says "colour"
            (frame-000000.color.png is "frame-000000"); recorded detections are matched by it.
        stamp: seconds.
        color: (H, W, 3) uint8, RGB.
        depth: (H, W) float32, metres along z, registered to colour; 0 = no reading. With a scan: its points projected.
        intrinsics: of both images.
        T_world_camera: (4, 4) ground-truth pose in the dataset's world, or None.
        specific_force: (3,) accelerometer reading in camera axes, m/s^2 (points up at rest), or None.
        scan: the sweep of a LiDAR, or None where depth is a camera's.
    """

    index: int
    name: str
    stamp: float
    color: np.ndarray
    depth: np.ndarray
    intrinsics: Intrinsics
    T_world_camera: np.ndarray | None = None
    specific_force: np.ndarray | None = None
    scan: LidarScan | None = None

    @property
    def up_at_rest(self) -> np.ndarray | None:
        """(3,) unit vector up in camera axes by the accelerometer; None without one, or where a hand shakes it."""
        if self.specific_force is None:
            return None
        norm = float(np.linalg.norm(self.specific_force))
        return self.specific_force / norm if AT_REST[0] < norm < AT_REST[1] else None

    @property
    def has_image(self) -> bool:
        """Whether there is a camera: a LiDAR may come without."""
        return self.intrinsics.width > 0
