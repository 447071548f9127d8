"""Flat patches of depth images, and where other depth images see the surface there: loops over pixels."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

SIGNS = np.array([-1.0, 1.0])
MIN_PIXELS = 2  # of a patch's radius: fewer show no plane
MIN_POINTS = 3  # of an image in a cylinder: fewer are stray readings at edges


@njit(cache=True)
def fit_patches(depth, camera, pixels, radius, max_range, flatness, min_filled, min_cosine):
    """Planes about pixels.

    Args:
        depth: (F, H, W) metres.
        camera: (4,) fx, fy, cx, cy.
        pixels: (N, 3) image, row, column.
        radius, max_range, flatness, min_filled, min_cosine: what makes a patch (`ThicknessConfig`).

    Returns:
        (N, 3) metres, the pixel's point on its plane, and (N, 3) unit normals towards the camera, both in camera axes;
        NaN where there is no flat patch.
    """
    points, normals = np.full((len(pixels), 3), np.nan), np.full((len(pixels), 3), np.nan)
    fx, fy, cx, cy = camera
    height, width = depth.shape[1:]
    for n in range(len(pixels)):
        image, v0, u0 = depth[pixels[n, 0]], pixels[n, 1], pixels[n, 2]
        z0 = float(image[v0, u0])
        reach_u, reach_v = int(radius * fx / max(z0, 1e-3)), int(radius * fy / max(z0, 1e-3))
        inside = reach_u <= u0 < width - reach_u and reach_v <= v0 < height - reach_v
        if not (0.0 < z0 <= max_range) or min(reach_u, reach_v) < MIN_PIXELS or not inside:
            continue
        # z^-1 = a u + b v + c on a plane; here relative to the centre, so that a, b, c are of one size
        A, y, count, valid = np.zeros((3, 3)), np.zeros(3), 0, 0
        for v in range(v0 - reach_v, v0 + reach_v + 1):
            for u in range(u0 - reach_u, u0 + reach_u + 1):
                count += 1
                z = float(image[v, u])
                if z > 0.0 and abs(z - z0) < 4.0 * radius:
                    row = np.array([(u - u0) / fx, (v - v0) / fy, 1.0])
                    A += np.outer(row, row)
                    y += row / z
                    valid += 1
        if valid < min_filled * count:
            continue
        a, b, c = np.linalg.solve(A, y)
        # n . x = 1 for x = z [(u - cx) / fx, (v - cy) / fy, 1]
        normal = np.array([a, b, c - a * (u0 - cx) / fx - b * (v0 - cy) / fy])
        size = np.sqrt(np.sum(normal**2))
        ray = np.array([(u0 - cx) / fx, (v0 - cy) / fy, 1.0])
        if c <= 0.0 or np.dot(normal, ray) < min_cosine * size * np.sqrt(np.sum(ray**2)):
            continue
        error = 0.0
        for v in range(v0 - reach_v, v0 + reach_v + 1):
            for u in range(u0 - reach_u, u0 + reach_u + 1):
                z = float(image[v, u])
                if z > 0.0 and abs(z - z0) < 4.0 * radius:
                    error += ((z * (a * (u - u0) / fx + b * (v - v0) / fy + c) - 1.0) / size) ** 2
        if math.sqrt(error / valid) > flatness * max(z0 * z0, 0.25):
            continue
        points[n], normals[n] = ray / c, -normal / size
    return points, normals


@njit(cache=True)
def offsets(image, camera, points, normals, radius, reach, max_range, min_cosine, result):
    """Where an image shows the surface along the normals of patches.

    Args:
        image: (H, W) metres.
        camera: (4,) fx, fy, cx, cy.
        points, normals: (N, 3) in this image's camera axes, metres.
        radius, reach: m, of the cylinder about a patch, and half its length.
        max_range, min_cosine: where depth is trusted (`ThicknessConfig`).
        result: (N,) metres, written where the image tells: the median of the points in the cylinder, `-reach` where
            the image sees through it.
    """
    fx, fy, cx, cy = camera
    height, width = image.shape
    found = np.empty(image.size)
    for n in range(len(points)):
        p, normal = points[n], normals[n]
        distance = np.sqrt(np.sum(p**2))
        if not (reach < p[2] <= max_range) or -np.dot(p, normal) < min_cosine * distance:
            continue
        u0, v0 = fx * p[0] / p[2] + cx, fy * p[1] / p[2] + cy
        if not (0 <= u0 < width - 1 and 0 <= v0 < height - 1):
            continue
        # the image of the cylinder: its two ends, and its radius about them
        low_u, high_u, low_v, high_v = u0, u0, v0, v0
        for sign in SIGNS:
            x, y, z = p + sign * reach * normal
            z = max(z, 0.1)
            u, v = fx * x / z + cx, fy * y / z + cy
            low_u, high_u = min(low_u, u - radius * fx / z), max(high_u, u + radius * fx / z)
            low_v, high_v = min(low_v, v - radius * fy / z), max(high_v, v + radius * fy / z)
        count = 0
        for v in range(max(int(low_v), 0), min(int(high_v) + 2, height)):
            for u in range(max(int(low_u), 0), min(int(high_u) + 2, width)):
                z = float(image[v, u])
                if z <= 0.0:
                    continue
                x, y, z = z * (u - cx) / fx - p[0], z * (v - cy) / fy - p[1], z - p[2]
                along = x * normal[0] + y * normal[1] + z * normal[2]
                if abs(along) <= reach and x * x + y * y + z * z - along * along <= radius * radius:
                    found[count] = along
                    count += 1
        if count >= MIN_POINTS:
            result[n] = np.median(found[:count])
        elif image[int(v0 + 0.5), int(u0 + 0.5)] > p[2] * (1.0 - reach / np.dot(p, normal)):
            result[n] = -reach  # this ray has passed through the patch, and through the cylinder behind it
