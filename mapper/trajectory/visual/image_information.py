"""What the brightness of two images says about the motion between them, where their depth may say nothing.

A pixel of b with point p, moved into a, should be as bright as what it falls on:

    r_i = I_a(pi(T p_i)) - I_b(i),     J_i = grad I_a · dpi/dq · R [ -[p_i]_x, I ],     H = sum_i J_i^T J_i

for the right tangent [rot, trans] of T = T_a_b, with the pinhole projection pi. Noise has gradients too, which would
hold a pose before a bare wall: images are smoothed, and pixels whose gradient does not stand out say nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from ....datasets.frame import Intrinsics
from ...config import HybridConfig
from ..rgbd_view import RgbdView

MAD_TO_SIGMA = 1.4826  # of a Gaussian
SIGMA_FLOOR = 0.5  # grey levels: keeps noise-free (rendered) images from infinite information


@dataclass(frozen=True, slots=True, eq=False)
class ImageInformation:
    """What brightness says about a pose.

    Attributes:
        hessian: (6, 6), the module's H, grey levels squared per rad or metre squared; positive semidefinite.
        sigma: robust standard deviation of the residuals, grey levels; NaN without pixels.
        shift: px, by which edges lie apart: sigma over the gradients' root mean square; NaN without pixels.
        pixels: that have a gradient and are seen in both images.
    """

    hessian: np.ndarray
    sigma: float
    shift: float
    pixels: int


def image_information(a: RgbdView, b: RgbdView, T_a_b: np.ndarray, config: HybridConfig) -> ImageInformation:
    """The module's equation at (4, 4) `T_a_b`, the final pose of a registration of two views of one camera."""
    intrinsics = a.intrinsics
    pixels, points = b.points(config.pixel_step, config.depth_range)
    seen = points @ T_a_b[:3, :3].T + T_a_b[:3, 3]
    ahead = seen[:, 2] > config.depth_range[0]
    pixels, points, seen = pixels[ahead], points[ahead], seen[ahead]
    uv = intrinsics.project(seen)
    near = np.rint(uv).astype(int)
    inside = ((near >= 1) & (near < [intrinsics.width - 1, intrinsics.height - 1])).all(axis=1)
    pixels, points, seen, uv, near = pixels[inside], points[inside], seen[inside], uv[inside], near[inside]
    smooth_a, smooth_b = _smooth(a.color, config.blur), _smooth(b.color, config.blur)
    x, y = near.T
    gradient = np.stack([_slope(smooth_a, y, x, 0, 1), _slope(smooth_a, y, x, 1, 0)], axis=1)
    facing = np.abs(a.depth[y, x] - seen[:, 2]) < config.max_distance  # else one hides the other, or has no reading
    steepness = np.linalg.norm(gradient, axis=1)
    used = facing & (steepness > config.min_gradient)
    if not used.any():
        return ImageInformation(np.zeros((6, 6)), math.nan, math.nan, 0)
    expected = smooth_a[y, x] + ((uv - near) * gradient).sum(axis=1)
    residual = (expected - smooth_b[pixels[:, 1], pixels[:, 0]])[used]
    sigma = math.hypot(MAD_TO_SIGMA * float(np.median(np.abs(residual))), SIGMA_FLOOR)
    shift = sigma / float(np.sqrt(np.mean(steepness[used] ** 2)))
    J = _jacobian(gradient[used], seen[used], points[used], T_a_b[:3, :3], intrinsics)
    return ImageInformation(J.T @ J, sigma, shift, len(J))


def _smooth(color: np.ndarray, blur: float) -> np.ndarray:
    """(H, W) float32 grey levels."""
    return cv2.GaussianBlur(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY).astype(np.float32), (0, 0), blur)


def _slope(image: np.ndarray, y: np.ndarray, x: np.ndarray, dy: int, dx: int) -> np.ndarray:
    """(N,) central differences, grey levels a pixel."""
    return (image[y + dy, x + dx] - image[y - dy, x - dx]) / 2.0


def _jacobian(
    gradient: np.ndarray, seen: np.ndarray, points: np.ndarray, R: np.ndarray, intrinsics: Intrinsics
) -> np.ndarray:
    """(N, 6) of the brightness residuals: `seen` = R `points` + t."""
    x, y, z = seen.T
    gx, gy = gradient[:, 0] * intrinsics.fx / z, gradient[:, 1] * intrinsics.fy / z
    by_point = np.stack([gx, gy, -(gx * x + gy * y) / z], axis=1) @ R
    return np.concatenate([np.cross(points, by_point), by_point], axis=1)
