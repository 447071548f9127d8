"""The outcome of every pixel of a projected volume, without a root or a trigonometric function for any of them.

In the coordinates where the ellipsoid is the unit ball the camera is at o and a ray of unit depth is q = u c + b, which
is linear in the column u, so that q z + o is where it is at depth z. Along a row of pixels:

    entry     The faces of the box are the planes ±1. A ray that meets the ball enters the box by a face that the camera
              is beyond, |o_i| > 1, at depth z = (1 - |o_i|) sign(o_i) / q_i. Of several it is the last, so its inverse
              1/z = min q_i sign(o_i) / (1 - |o_i|) is linear in u but for the minimum.
    occluded  (z + tolerance) / entry < 1
    free      |q s + o|² > 1 beyond the ray's nearest point to the centre, q · (q s + o) > 0, with s = z - tolerance
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .depth_likelihood import mixture_terms
from .outline import outline_area, row_span
from .volume import camera_quadric, project_kernel

OCCLUDED, AGREEING, FREE, MISSING, LOG_RATIO = range(5)  # columns of a tally; the last is a sum of nats, not a count
SMALL_PX = 16  # a silhouette narrower than this is sampled at every pixel
NO_LIKELIHOOD = (0.0, 1.0, 0.0, 1.0, 1.0)  # every pixel an outlier: log ratios of zero
_SAME = 1e-12  # of the gain: a pixel that far from the expected surface counts as an outlier, without an exponential


@njit(cache=True)
def tally_volumes(depth, camera, T, R, centers, log_half_axes, step, tolerance, mixture, tallies, in_image, pixels):
    """Measure N volumes; those that are not wholly in front of the camera are left as they are.

    Args:
        depth: (H, W) float32 metres.
        camera: (4,) fx, fy, cx, cy.
        T, R: T_world_camera (4, 4), R_world_upright (3, 3).
        centers, log_half_axes: (N, 3).
        step: every step-th row and column is looked at.
        tolerance: (2,) metres, and metres at 1 m that grow with z².
        mixture: `DepthLikelihood.numbers`, or `NO_LIKELIHOOD`.
        tallies: (N, 5, 5) to fill, by part and by column as above; of all pixels, those that were skipped included.
        in_image: (N, 5) to fill, share of the part's silhouette inside the image.
        pixels: (N,) to fill, pixels of the whole silhouette inside the image.
    """
    xyxy, unused = np.empty(4), np.zeros((4, 12))
    for n in range(len(centers)):
        if project_kernel(T, R, centers[n], log_half_axes[n], xyxy, unused, False):
            for side in range(4):
                xyxy[side] = camera[side % 2] * xyxy[side] + camera[2 + side % 2]
            pixels[n] = _tally_volume(
                depth,
                camera,
                T,
                R,
                centers[n],
                log_half_axes[n],
                step,
                tolerance,
                mixture,
                xyxy,
                tallies[n],
                in_image[n],
            )


@njit(cache=True)
def _tally_volume(depth, camera, T, R, center, log_half_axes, step, tolerance, mixture, xyxy, tally, in_image):
    """Fill tally (5, 5) and in_image (5,) of one volume with the box xyxy; return its pixels in the image.

    Row by row: where the silhouette begins and ends is the root of a quadratic, so only its own pixels are visited.
    """
    height, width = depth.shape
    fx, fy, cx, cy = camera
    A, M, t = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    camera_quadric(T, R, center, log_half_axes, A, M, t)
    to_ball = (A / np.exp(log_half_axes)).T.copy()  # to where the ellipsoid is the unit ball
    origin, column, row = -(to_ball @ t), to_ball[:, 0].copy(), np.empty(3)  # of the camera and its rays, there
    terms = _pixel_terms(mixture, tolerance, origin, t[2])
    step = step if min(xyxy[2] - xyxy[0], xyxy[3] - xyxy[1]) >= SMALL_PX else 1
    u_mid, v_mid = (xyxy[0] + xyxy[2]) / 2.0, (xyxy[1] + xyxy[3]) / 2.0
    u_right = math.ceil(u_mid)  # first column of the right half
    first, last = max(math.ceil(xyxy[1]), 0), min(math.floor(xyxy[3]), height - 1)
    area, area_left, area_top, pixels = 0.0, 0.0, 0.0, 0
    for v in range(first, last + 1):
        for i in range(3):
            row[i] = to_ball[i, 1] * (v - cy) / fy + to_ball[i, 2]
        lo, hi = row_span(column, row, origin)
        lo, hi = max(fx * lo + cx, -0.5), min(fx * hi + cx, width - 0.5)
        if not lo < hi:
            continue
        area += hi - lo
        area_left += max(min(hi, u_mid) - lo, 0.0)
        area_top += (hi - lo) * min(max(v_mid - v + 0.5, 0.0), 1.0)
        begin, end = math.ceil(lo), min(math.floor(hi), width - 1) + 1
        pixels += max(end - begin, 0)
        if (v - first) % step == 0:
            vertical = 1 if v < v_mid else 2  # numbers of `VolumePart`: top, bottom; 3 and 4 are left and right
            split = min(max(u_right, begin), end)
            split += (begin - split) % step  # the right half goes on in steps of the left one
            _tally_run(depth[v], begin, min(split, end), step, cx, fx, column, row, origin, terms, tally, vertical, 3)
            _tally_run(depth[v], split, end, step, cx, fx, column, row, origin, terms, tally, vertical, 4)
    tally *= step * step
    for outcome in range(tally.shape[1]):
        tally[0, outcome] = tally[1, outcome] + tally[2, outcome]
    in_image[:] = 1.0
    if not (xyxy[0] >= -0.5 and xyxy[1] >= -0.5 and xyxy[2] <= width - 0.5 and xyxy[3] <= height - 0.5):
        full = fx * fy * outline_area(M, t)  # of which every half has half
        inside = (area, 2.0 * area_top, 2.0 * (area - area_top), 2.0 * area_left, 2.0 * (area - area_left))
        for part in range(5):
            in_image[part] = min(inside[part] / full, 1.0)
    return pixels


@njit(cache=True)
def _pixel_terms(mixture, tolerance, origin, depth):
    """What is the same for all pixels of a volume: tolerance (2), offset, outlier, gain, sharpness, reach [m]."""
    outlier = mixture[3]
    if outlier >= 1.0:
        return tolerance[0], tolerance[1], 0.0, 1.0, 0.0, 0.0, 0.0
    half_depth = depth / math.sqrt(origin[0] ** 2 + origin[1] ** 2 + origin[2] ** 2)
    offset, gain, sharpness = mixture_terms(mixture, half_depth, depth, tolerance[0] + tolerance[1] * depth * depth)
    return tolerance[0], tolerance[1], offset, outlier, gain, sharpness, math.sqrt(-math.log(_SAME) / sharpness)


@njit(cache=True, error_model="numpy")
def _tally_run(depths, begin, end, step, cx, fx, column, row, origin, terms, tally, vertical, horizontal):
    """Add the pixels of a row from column begin to before end to the tallies of two halves of the volume."""
    fixed, growing, offset, outlier, gain, sharpness, reach = terms
    c0, c1, c2 = column[0] / fx, column[1] / fx, column[2] / fx  # of the ray q, per pixel
    b0, b1, b2 = row[0] - c0 * cx, row[1] - c1 * cx, row[2] - c2 * cx
    o0, o1, o2 = origin[0], origin[1], origin[2]
    (m0, n0), (m1, n1), (m2, n2) = _nearness(o0, c0, b0), _nearness(o1, c1, b1), _nearness(o2, c2, b2)
    outside = o0 * o0 + o1 * o1 + o2 * o2 - 1.0
    occluded, agreeing, free, missing, outliers = 0, 0, 0, 0, 0
    log_ratio, product = 0.0, 1.0
    for u in range(begin, end, step):
        z = float(depths[u])
        if not 0.0 < z < np.inf:
            missing += 1
            continue
        nearness = min(m0 * u + n0, m1 * u + n1, m2 * u + n2)
        tolerance = fixed + growing * z * z
        if (z + tolerance) * nearness < 1.0:
            occluded += 1
            continue
        s = z - tolerance
        q0, q1, q2 = c0 * u + b0, c1 * u + b1, c2 * u + b2
        qq, qo = q0 * q0 + q1 * q1 + q2 * q2, q0 * o0 + q1 * o1 + q2 * o2
        if (qq * s + 2.0 * qo) * s + outside > 0.0 and qq * s + qo > 0.0:
            free += 1
        else:
            agreeing += 1
        r = z - 1.0 / nearness - offset
        if abs(r) < reach:
            product *= outlier + gain * math.exp(-sharpness * r * r)  # one logarithm for many pixels
            if not 1e-100 < product < 1e100:
                log_ratio += math.log(product)
                product = 1.0
        else:
            outliers += 1
    log_ratio += math.log(product) + outliers * math.log(outlier)
    for part in (vertical, horizontal):
        tally[part, OCCLUDED] += occluded
        tally[part, AGREEING] += agreeing
        tally[part, FREE] += free
        tally[part, MISSING] += missing
        tally[part, LOG_RATIO] += log_ratio


@njit(cache=True)
def _nearness(o, c, b):
    """Slope and start, over u, of the inverse depth at which a ray u c + b from o enters by the faces of one axis."""
    if abs(o) <= 1.0:
        return 0.0, np.inf  # the camera is between the two: every ray enters by another axis, if at all
    factor = math.copysign(1.0, o) / (1.0 - abs(o))
    return c * factor, b * factor
