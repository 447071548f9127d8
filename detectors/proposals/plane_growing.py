"""Planes of a point grid, grown from small squares of it: the kernels.

A square whose points lie in a plane joins a neighbour's plane that it agrees with; the plane is fitted again to all its
squares from their summed moments. Own kernels: OpenCV's `findPlanes` adds in parallel, so that its planes differ in the
last digits from run to run.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .config import DEPTH_SIGMA

MOMENTS = 10  # count, sums of x y z, of xx xy xz yy yz zz
FLATNESS = 2.0  # a square is flat where its points scatter by less than this many standard deviations of the depth
FLATNESS_FLOOR = 0.002  # metres


@njit(cache=True)
def cell_moments(points, cell):  # pragma: no cover
    """(rows, columns, 10) moments of the squares of `cell` points, of points with depth > 0; whole squares only."""
    rows, columns = points.shape[0] // cell, points.shape[1] // cell
    out = np.zeros((rows, columns, MOMENTS))
    for r in range(rows):
        for c in range(columns):
            for y in range(r * cell, (r + 1) * cell):
                for x in range(c * cell, (c + 1) * cell):
                    z = float(points[y, x, 2])
                    if z <= 0.0:
                        continue
                    a, b = float(points[y, x, 0]), float(points[y, x, 1])
                    m = out[r, c]
                    m[0] += 1.0
                    m[1] += a
                    m[2] += b
                    m[3] += z
                    m[4] += a * a
                    m[5] += a * b
                    m[6] += a * z
                    m[7] += b * b
                    m[8] += b * z
                    m[9] += z * z
    return out


@njit(cache=True)
def fit_plane(m):  # pragma: no cover
    """(normal x y z, centre x y z, rms) of least squares; the normal points to the camera."""
    out = np.empty(7)
    n = m[0]
    x, y, z = m[1] / n, m[2] / n, m[3] / n
    cov = np.empty((3, 3))
    cov[0, 0] = m[4] / n - x * x
    cov[0, 1] = cov[1, 0] = m[5] / n - x * y
    cov[0, 2] = cov[2, 0] = m[6] / n - x * z
    cov[1, 1] = m[7] / n - y * y
    cov[1, 2] = cov[2, 1] = m[8] / n - y * z
    cov[2, 2] = m[9] / n - z * z
    values, vectors = np.linalg.eigh(cov)
    sign = -1.0 if vectors[0, 0] * x + vectors[1, 0] * y + vectors[2, 0] * z > 0.0 else 1.0
    for k in range(3):
        out[k] = sign * vectors[k, 0]
    out[3], out[4], out[5] = x, y, z
    out[6] = np.sqrt(max(values[0], 0.0))
    return out


@njit(cache=True)
def grow_planes(moments, least_count, joining_cosine, tolerance, sigmas):  # pragma: no cover
    """Squares joined into planes.

    Returns:
        (rows, columns) int32 plane of each square, -1 for none; (P, 10) moments of the planes; (P, 7) their fits.
    """
    rows, columns = moments.shape[:2]
    fits = np.zeros((rows, columns, 7))
    fits[..., 6] = np.inf
    for r in range(rows):
        for c in range(columns):
            if moments[r, c, 0] >= least_count:
                fit = fit_plane(moments[r, c])
                if fit[6] < FLATNESS_FLOOR + FLATNESS * DEPTH_SIGMA * fit[5] * fit[5]:
                    fits[r, c] = fit
    owner = np.full((rows, columns), -1, dtype=np.int32)
    order = np.argsort(fits[..., 6].copy().reshape(-1), kind="mergesort")
    sums = np.zeros((rows * columns, MOMENTS))
    planes = np.zeros((rows * columns, 7))
    queue = np.empty(rows * columns, dtype=np.int64)
    count = 0
    for seed in order:
        r, c = seed // columns, seed % columns
        if not np.isfinite(fits[r, c, 6]):
            break
        if owner[r, c] >= 0:
            continue
        owner[r, c] = count
        sums[count] = moments[r, c]
        plane = fits[r, c].copy()
        queue[0], head, tail, fitted = seed, 0, 1, 1
        while head < tail:
            r, c = queue[head] // columns, queue[head] % columns
            head += 1
            for side in range(4):
                y, x = r + (side == 0) - (side == 1), c + (side == 2) - (side == 3)
                if y < 0 or y >= rows or x < 0 or x >= columns or owner[y, x] >= 0:
                    continue
                fit = fits[y, x]
                if not np.isfinite(fit[6]):
                    continue
                if fit[0] * plane[0] + fit[1] * plane[1] + fit[2] * plane[2] < joining_cosine:
                    continue
                off = 0.0
                for k in range(3):
                    off += plane[k] * (fit[3 + k] - plane[3 + k])
                if abs(off) > tolerance + sigmas * DEPTH_SIGMA * fit[5] * fit[5]:
                    continue
                owner[y, x] = count
                sums[count] += moments[y, x]
                queue[tail] = y * columns + x
                tail += 1
                if tail >= 1.5 * fitted:
                    plane, fitted = fit_plane(sums[count]), tail
        planes[count] = fit_plane(sums[count])
        count += 1
    return owner, sums[:count], planes[:count]


@njit(cache=True)
def join_planes(order, sums, fits, joining_cosine, tolerance, sigmas, rms, rms_sigmas):  # pragma: no cover
    """Pieces that lie in one plane joined, each to the first that it fits.

    Args:
        order: pieces to look at, largest first; the others belong to no plane.
        sums: (P, 10) moments.
        fits: (P, 7).

    Returns:
        (P,) int32 plane of each piece, -1 for none, and (Q, 7) fits of the planes.
    """
    number = np.full(len(fits), -1, dtype=np.int32)
    groups, planes = np.empty((len(order), MOMENTS)), np.empty((len(order), 7))
    count = 0
    for piece in order:
        fit = fits[piece]
        for g in range(count):
            plane = planes[g]
            cosine = off = 0.0
            for k in range(3):
                cosine += plane[k] * fit[k]
                off += plane[k] * (fit[3 + k] - plane[3 + k])
            depth = max(fit[5], plane[5])
            if cosine < joining_cosine or abs(off) > tolerance + sigmas * DEPTH_SIGMA * depth * depth:
                continue
            both = fit_plane(groups[g] + sums[piece])
            if both[6] < rms + rms_sigmas * DEPTH_SIGMA * both[5] ** 2:
                groups[g] += sums[piece]
                planes[g] = both
                number[piece] = g
                break
        if number[piece] < 0:
            number[piece] = count
            groups[count], planes[count] = sums[piece], fit
            count += 1
    return number, planes[:count].copy()


@njit(cache=True)
def assign_points(points, facing, owner, normals, offsets, cell, reach, tolerance, sigmas, cosine):  # pragma: no cover
    """(h, w) int32: the plane that each point lies on, -1 for none.

    Args:
        points: (h, w, 3).
        facing: (h, w, 3) their normals, zero where unknown.
        owner: (rows, columns) plane of each square of `cell` points, -1 for none.
        normals, offsets: (P, 3), (P,): n . x = offset.
        reach: points around a plane's squares where it is looked for.
        tolerance, sigmas: how far off it a point may be.
        cosine: least one between the plane's normal and the point's, where that is known: the foot of a thing is near
            the plane that it stands on, but does not face as it does.
    """
    height, width = points.shape[:2]
    rows, columns = owner.shape
    out = np.full((height, width), -1, dtype=np.int32)
    for y in range(height):
        top, bottom = max(0, (y - reach) // cell), min(rows - 1, (y + reach) // cell)
        for x in range(width):
            z = points[y, x, 2]
            if z <= 0.0:
                continue
            best = tolerance + sigmas * DEPTH_SIGMA * z * z
            left, right = max(0, (x - reach) // cell), min(columns - 1, (x + reach) // cell)
            last = -1
            for r in range(top, bottom + 1):
                for c in range(left, right + 1):
                    p = owner[r, c]
                    if p < 0 or p == last:
                        continue
                    last = p
                    off = along = length = 0.0
                    for k in range(3):
                        off += normals[p, k] * points[y, x, k]
                        along += normals[p, k] * facing[y, x, k]
                        length += abs(facing[y, x, k])
                    off = abs(off - offsets[p])
                    if length > 0.0 and along < cosine:
                        continue
                    if off < best or (off == best and out[y, x] == -1):
                        best = off
                        out[y, x] = p
    return out
