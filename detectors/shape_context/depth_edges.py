"""Where depth jumps: Canny's edges of inverse depth, less the slant of surfaces (Georgakis et al., section III-A)."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit

from .boundaries import linked, steadied, thinned
from .edge_config import DepthEdgeConfig

UNKNOWN = 1 << 20  # length of a hole without a reading at either end
ONE_END = 2  # a hole that reaches the border of the image counts as so many times as long
DESPECKLING = 5  # pixels, side of the median
BORDER = 3  # pixels, about twice the blur
NEAREST = 0.01  # metres; no camera reads less


def depth_edges(
    depth: np.ndarray, config: DepthEdgeConfig | None = None, inverse: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Thin lines where depth jumps.

    The inverse depth of a plane is linear in the image: its gradient, taken a little to both sides of a point, is what
    the gradient at the point would be without a step, and is subtracted.

    Args:
        depth: (H, W) metres; no reading where it is not a finite number above `NEAREST`.
        config: all numbers.
        inverse: what `inverse_depth` says of it, if known.

    Returns:
        (H, W) bool, and (H, W) float32 radians, the direction across the edge.
    """
    config = DepthEdgeConfig() if config is None else config
    is_read = readings(depth)
    if not is_read.any():
        return np.zeros(depth.shape, bool), np.zeros(depth.shape, np.float32)
    inverse = inverse_depth(depth, config) if inverse is None else inverse
    smooth = cv2.GaussianBlur(cv2.medianBlur(inverse, DESPECKLING), (0, 0), config.sigma)
    # an ideal step of height h, blurred, has the largest gradient h / (sigma sqrt(2 pi)); Sobel's has twice that
    height = config.sigma * np.sqrt(2.0 * np.pi) / 2.0
    across = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=1, scale=height)
    down = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=1, scale=height)
    step = _without_slant(across, down, config.slant_reach, config.unevenness, config.low)
    is_thin = thinned(step[0], step[1], config.low)
    is_thin &= cv2.dilate(is_read.astype(np.uint8), square(config.near_reading)) > 0
    twice = steadied(step[0], step[1], config.sigma)
    strength = np.where(is_thin, np.hypot(step[0], step[1]), np.float32(0.0))
    return linked(strength, config.low, config.high, config.min_length), 0.5 * np.arctan2(twice[..., 1], twice[..., 0])


def readings(depth: np.ndarray) -> np.ndarray:
    """(H, W) bool: where there is a depth."""
    return np.isfinite(depth) & (depth > NEAREST)


def square(reach: int) -> np.ndarray:
    """Window of all pixels that are at most so many columns and rows away."""
    return np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)


def inverse_depth(depth: np.ndarray, config: DepthEdgeConfig | None = None) -> np.ndarray:
    """Inverse depth without holes.

    A hole is crossed where it is shorter, along its rows or its columns. If its two ends are one surface, allowing for
    the slant of the farther end, it is filled evenly; if not, all of it belongs to the farther surface, of which the
    nearer one hides a part from the camera's projector. The edge is then the nearer one's rim. A hole that reaches the
    border of the image has one end, whose reading fills it.

    Args:
        depth: as for `depth_edges`.
        config: all numbers.

    Returns:
        (H, W) float32, 1 / metre; all 0 without a reading.
    """
    config = DepthEdgeConfig() if config is None else config
    is_known = readings(depth)
    inverse = np.zeros(depth.shape, np.float32)
    np.divide(1.0, depth, out=inverse, where=is_known)
    if not is_known.any():
        return inverse
    numbers = config.bridge, config.max_slant, config.slant_base
    while not is_known.all():  # twice at most: the first round completes every row that has a reading
        in_rows, wide = _bridged(inverse, is_known, *numbers)
        in_columns, high = _bridged(np.ascontiguousarray(inverse.T), np.ascontiguousarray(is_known.T), *numbers)
        inverse = np.where(wide <= high.T, in_rows, in_columns.T)
        is_known = np.minimum(wide, high.T) < UNKNOWN
    return inverse


@njit(cache=True, nogil=True)
def _bridged(inverse, is_known, bridge, max_slant, slant_base):
    """Holes filled along rows, and (H, W) int32 length of the hole that each pixel is in, 0 outside."""
    rows, columns = inverse.shape
    out = inverse.copy()
    length = np.zeros((rows, columns), np.int32)
    for y in range(rows):
        end = 0
        while end < columns:
            start = end
            while start < columns and is_known[y, start]:
                start += 1
            end = start
            while end < columns and not is_known[y, end]:
                end += 1
            has_left, has_right = start > 0, end < columns
            if has_left and has_right:
                left, right = _rims(inverse[y], is_known[y], start, end, bridge, max_slant, slant_base)
                length[y, start:end] = end - start
            elif has_left or has_right:
                left = right = inverse[y, start - 1] if has_left else inverse[y, end]
                length[y, start:end] = ONE_END * (end - start)
            else:
                left = right = np.float32(0.0)
                length[y, start:end] = UNKNOWN
            for x in range(start, end):
                out[y, x] = left + (right - left) * (x + 1 - start) / (end + 1 - start)
    return out, length


@njit(cache=True, nogil=True)
def _rims(row, is_known, start, end, bridge, max_slant, slant_base):
    """Inverse depth at both ends of the hole from `start` to `end`; that of the farther end twice, if they differ."""
    left, right = row[start - 1], row[end]
    if left < right:
        far, near, base = left, right, max(start - 1 - slant_base, 0)
        run = start - 1 - base
    else:
        far, near, base = right, left, min(end + slant_base, len(row) - 1)
        run = base - end
    slant = (far - row[base]) / run if run > 0 and is_known[base] else 0.0
    slant = min(max(slant, 0.0), max_slant)
    if near - far <= bridge + slant * (end + 1 - start):
        return left, right
    return far, far


@njit(cache=True, nogil=True)
def _without_slant(across, down, reach, unevenness, least):
    """(2, H, W) float32 gradient less its mean `reach` pixels to both sides; 0 where it is shorter than `least`.

    It is shortened by `unevenness` times that mean, too.

    Towards the border of the image, where the blur flattens all slants, the other side alone is taken.
    """
    rows, columns = across.shape
    out = np.zeros((2, rows, columns), np.float32)
    for y in range(rows):
        for x in range(columns):
            gx, gy = across[y, x], down[y, x]
            size = np.sqrt(gx * gx + gy * gy)
            if size < least:
                continue
            nx, ny = gx / size, gy / size
            slant_x, slant_y, sides = np.float32(0.0), np.float32(0.0), 0
            for side in (-reach, reach):
                u, v = int(np.floor(x + side * nx + 0.5)), int(np.floor(y + side * ny + 0.5))
                if BORDER <= u < columns - BORDER and BORDER <= v < rows - BORDER:
                    sides += 1
                    if across[v, u] * nx + down[v, u] * ny > 0.0:  # else it is the other rim of a thin thing
                        slant_x += across[v, u]
                        slant_y += down[v, u]
            slant_x, slant_y = slant_x / max(sides, 1), slant_y / max(sides, 1)
            step = size - slant_x * nx - slant_y * ny
            left = step - unevenness * (size - step)
            if left > 0.0:
                out[0, y, x], out[1, y, x] = (gx - slant_x) * left / step, (gy - slant_y) * left / step
    return out
