"""The surface that a frame shows at some of its pixels: points, normals and colours.

`point_grid` of the detectors makes a cleaner grid of squares; here points are those of single pixels, which evidence
belongs to, and noise goes in the mean over a voxel's points. It also takes 10 ms instead of one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from ...datasets.frame import Frame

REACH = 6  # pixels to either side over which depth's slope is taken: 2 cm at 2 m of a Kinect, whose noise there tilts a
# normal by ten degrees; less, and it tilts them more, further, and they round the edges of cups
SAME_SURFACE = 0.04  # share of depth by which a surface may rise or fall over `REACH`: tilted by up to 74 degrees


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """P points, in the order of the pixels that were asked for.

    Attributes:
        points: (P, 3) float32 metres, camera axes.
        normals: (P, 3) float32 unit vectors, camera axes, towards the camera (n . x < 0); NaN where depth jumps or has
            no readings on both sides.
        colours: (P, 3) uint8 RGB.
    """

    points: np.ndarray
    normals: np.ndarray
    colours: np.ndarray


def surface_of(frame: Frame, uv: np.ndarray) -> Surface:
    """The surface at (P, 2) integer pixels (column, row) of a frame whose depth is of the colour image's size.

    Raises:
        ValueError: a pixel is outside of the image, or has no depth.
    """
    k, (height, width) = frame.intrinsics, frame.depth.shape
    uv = np.ascontiguousarray(uv, dtype=np.int32)
    depth, color = np.ascontiguousarray(frame.depth, dtype=np.float32), np.ascontiguousarray(frame.color)
    across, down = (np.arange(width) - k.cx) / k.fx, (np.arange(height) - k.cy) / k.fy
    camera = np.array([k.fx, k.fy, k.cx, k.cy])
    points, normals, colours, outside, without_depth = _surface(depth, color, uv, camera, across, down)
    if outside:
        raise ValueError(f"pixels must lie in the image of {width} x {height}")
    if without_depth:
        raise ValueError(f"every pixel must have a depth, but {without_depth} of {len(uv)} have none")
    return Surface(points, normals, colours)


@njit(cache=True, nogil=True, error_model="numpy")
def _surface(depth, color, uv, camera, across, down):  # pragma: no cover
    """A plane has 1 / z = a u + b v + c; its normal is the gradient of that with respect to the viewing ray, and minus
    that points to the camera.

    Args:
        across, down: (W,) and (H,) x / z of each column and y / z of each row, divided once and not at each pixel.
    """
    fx, fy, cx, cy = camera
    height, width = depth.shape
    count, outside, without_depth = len(uv), 0, 0
    points, normals = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    colours = np.empty((count, 3), np.uint8)
    absent = np.float32(np.nan)
    for p in range(count):
        u, v = np.int64(uv[p, 0]), np.int64(uv[p, 1])
        if not (0 <= u < width and 0 <= v < height):
            outside += 1
            continue
        z = depth[v, u]
        if not 0.0 < z < np.inf:
            without_depth += 1
            continue
        points[p, 0], points[p, 1], points[p, 2] = across[u] * z, down[v] * z, z
        colours[p, 0], colours[p, 1], colours[p, 2] = color[v, u, 0], color[v, u, 1], color[v, u, 2]
        left = depth[v, u - REACH] if u >= REACH else absent
        right = depth[v, u + REACH] if u + REACH < width else absent
        above = depth[v - REACH, u] if v >= REACH else absent
        below = depth[v + REACH, u] if v + REACH < height else absent
        a, b = _slope(left, z, right), _slope(above, z, below)
        x, y, w = a * fx, b * fy, 1.0 / z - a * (u - cx) - b * (v - cy)
        length = -np.sqrt(x * x + y * y + w * w)
        normals[p, 0], normals[p, 1], normals[p, 2] = x / length, y / length, w / length
    return points, normals, colours, outside, without_depth


@njit(cache=True, nogil=True, error_model="numpy")
def _slope(before, z, after):  # pragma: no cover
    """Of 1 / z a pixel, along a row or a column: of the sides that are of one surface with the middle; NaN if none.

    Sides are numbers (NaN outside of the image), not places in `depth`: numba counts an array's users in every call
    that is given one, which took more than half the time of all (34 000 pixels: 1.3 ms, and 0.6 without).
    """
    first = last = np.float32(1.0) / z
    span = 0
    if abs(before - z) < SAME_SURFACE * z:
        first = np.float32(1.0) / before
        span += REACH
    if abs(after - z) < SAME_SURFACE * z:
        last = np.float32(1.0) / after
        span += REACH
    return (last - first) / np.float32(span) if span > 0 else np.float32(np.nan)
