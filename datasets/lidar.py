"""A LiDAR's sweep, and what a camera beside it sees of its points.

A camera's pixel lies between the scanner's lines more often than on one, and behind a near thing the scanner, which
looks from elsewhere, sees what the camera cannot. `project_scan` therefore

    1. keeps the nearest point of every pixel,
    2. drops points that shine through a nearer surface: those with nearer points both above and below them, or both
       left and right, within twice the splat's reach (on a ground that recedes, nearer points are below only),
    3. spreads every point left over the splat's rectangle; the nearest wins.

Points are taken as they are, motion within the sweep included: what the camera sees was measured near the stamp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from .frame import Frame, Intrinsics

NO_CAMERA = Intrinsics(0, 0, 1.0, 1.0, 0.0, 0.0)  # of a frame without an image
# T_camera_lidar of a camera at the scanner's place that looks forward: x right = -y, y down = -z, z forward = x
CAMERA_AXES = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
NO_COLOR = 128  # grey of points that no camera sees


@dataclass(frozen=True, slots=True, eq=False)
class LidarScan:
    """One sweep.

    Attributes:
        points: (N, 3) float32 metres, lidar axes: x forward, y left, z up.
        T_camera_lidar: (4, 4) lidar axes to camera axes.
        times: (N,) float64, when each point was measured, seconds after the frame's stamp (before it: negative); None
            where the points are of one moment, or were already moved to where they would have been seen from then.
    """

    points: np.ndarray
    T_camera_lidar: np.ndarray
    times: np.ndarray | None = None

    def camera_points(self) -> np.ndarray:
        """(N, 3) float64 points, camera axes, metres."""
        return self.points @ self.T_camera_lidar[:3, :3].T + self.T_camera_lidar[:3, 3]


@dataclass(frozen=True, slots=True)
class Splat:
    """How points become pixels.

    Attributes:
        half_width, half_height: pixels that a point is spread to each side of its own, and up and down. Two lines of a
            64-line scanner are about 5 pixels apart in KITTI's images: 4 up and down leave no gap where one is missed.
        nearer: of its depth, by which points before a point must be nearer to hide it.
        min_depth: m, nearer points are the vehicle's own.
    """

    half_width: int = 2
    half_height: int = 4
    nearer: float = 0.1
    min_depth: float = 0.5


def project_scan(scan: LidarScan, intrinsics: Intrinsics, splat: Splat = Splat()) -> np.ndarray:
    """(H, W) float32 depth along the camera's z, metres, 0 = no reading: the scan's points as the camera sees them."""
    points = scan.camera_points()
    points = points[points[:, 2] > splat.min_depth]
    uv = np.rint(intrinsics.project(points))
    inside = ((uv >= 0) & (uv < [intrinsics.width, intrinsics.height])).all(axis=1)
    depth = np.full((intrinsics.height, intrinsics.width), np.inf, dtype=np.float32)
    pixels = uv[inside].astype(np.int64)
    np.minimum.at(depth, (pixels[:, 1], pixels[:, 0]), points[inside, 2].astype(np.float32))
    rows, columns = np.nonzero(np.isfinite(depth))
    spread = _spread(depth, rows, columns, splat.half_width, splat.half_height, np.float32(1.0 - splat.nearer))
    spread[np.isinf(spread)] = 0.0
    return spread


def point_colors(frame: Frame, splat: Splat = Splat()) -> np.ndarray:
    """(N, 3) uint8 RGB of the scan's points as the image shows them; grey where it does not.

    Raises:
        ValueError: the frame has no scan.
    """
    if frame.scan is None:
        raise ValueError(f"frame {frame.name} has no scan")
    colors = np.full((len(frame.scan.points), 3), NO_COLOR, dtype=np.uint8)
    points, k = frame.scan.camera_points(), frame.intrinsics
    before = np.flatnonzero(points[:, 2] > splat.min_depth)
    uv = np.rint(k.project(points[before])).astype(np.int64)
    inside = ((uv >= 0) & (uv < [k.width, k.height])).all(axis=1)
    before, (column, row) = before[inside], uv[inside].T
    seen = points[before, 2] * (1.0 - splat.nearer) < frame.depth[row, column]
    colors[before[seen]] = frame.color[row[seen], column[seen]]
    return colors


@njit(cache=True)
def _spread(depth, rows, columns, half_width, half_height, share):
    """(H, W) depth of the pixels that are not hidden, each over its rectangle; infinite where there is none."""
    height, width = depth.shape
    spread = np.full_like(depth, np.inf)
    for i in range(len(rows)):
        v, u = rows[i], columns[i]
        z, limit = depth[v, u], depth[v, u] * share
        far_v, far_u = 2 * half_height, 2 * half_width
        if _any_nearer(depth, limit, v - far_v, v, u - half_width, u + half_width + 1) and _any_nearer(
            depth, limit, v + 1, v + far_v + 1, u - half_width, u + half_width + 1
        ):
            continue
        if _any_nearer(depth, limit, v - half_height, v + half_height + 1, u - far_u, u) and _any_nearer(
            depth, limit, v - half_height, v + half_height + 1, u + 1, u + far_u + 1
        ):
            continue
        for row in range(max(v - half_height, 0), min(v + half_height + 1, height)):
            for column in range(max(u - half_width, 0), min(u + half_width + 1, width)):
                spread[row, column] = min(spread[row, column], z)
    return spread


@njit(cache=True)
def _any_nearer(depth, limit, row_from, row_to, column_from, column_to):
    for row in range(max(row_from, 0), min(row_to, depth.shape[0])):
        for column in range(max(column_from, 0), min(column_to, depth.shape[1])):
            if depth[row, column] < limit:
                return True
    return False
