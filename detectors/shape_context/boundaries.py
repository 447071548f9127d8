"""Where colours differ: half-discs of several radii held against each other, in the place of the paper's gPb.

gPb (Arbelaez et al., Contour Detection and Hierarchical Image Segmentation, PAMI 2011) compares histograms of both
halves of discs at three radii, and adds an eigenvector problem of the whole image. Here the halves are compared by
their mean colours, and by how much the colours scatter within them: lines inside a texture differ at the finest radius
only.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numba import njit

from .edge_config import BoundaryConfig

DIRECTIONS = 8
ON_LINE = 0.3  # pixels from the line between two half-discs within which a pixel belongs to neither
BLUR = 1.0  # pixels of the half-size image, of the colours whose gradient gives a boundary its orientation
UNITS = 50.0  # of the least strength, for the 16-bit gradients that cv2.Canny takes


def color_boundaries(color: np.ndarray, config: BoundaryConfig | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Thin lines between colours.

    The contrast at radius r is |m1 - m2| / sqrt(1 + (s1^2 + s2^2) / texture^2), with the mean CIE Lab colours m and the
    scatter s of the two halves of a disc; at the finest radius, which says where the line is, |m1 - m2|. A point's
    strength is the geometric mean over the radii: a boundary has to show at all of them.

    Args:
        color: (H, W, 3) uint8, RGB.
        config: all numbers.

    Returns:
        (H, W) bool, and (H, W) float32 radians, the direction across the boundary.
    """
    config = BoundaryConfig() if config is None else config
    shape = color.shape[:2]
    lab = cv2.cvtColor(color.astype(np.float32) / 255.0, cv2.COLOR_RGB2LAB)
    half = cv2.resize(lab, ((shape[1] + 1) // 2, (shape[0] + 1) // 2), interpolation=cv2.INTER_AREA)
    pad = config.radii[-1] // 2
    sums = _row_sums(half, pad)
    fine = _contrast(sums, half_discs(config.radii[0] // 2), pad)
    size = cv2.resize(fine, shape[::-1], interpolation=cv2.INTER_LINEAR)
    orientation = cv2.resize(_gradient_squared(half), shape[::-1], interpolation=cv2.INTER_LINEAR)
    orientation = 0.5 * np.arctan2(orientation[..., 1], orientation[..., 0])
    is_thin = thinned(size * np.cos(orientation), size * np.sin(orientation), config.low)
    rows, columns = np.nonzero(is_thin)
    product = size[rows, columns].copy()
    for radius in config.radii[1:]:
        discs = half_discs(radius // 2)
        product *= _contrast_at(sums, discs, pad, config.texture**2, rows, columns, orientation[rows, columns])
    strength = np.zeros(shape, np.float32)
    strength[rows, columns] = product ** (1.0 / len(config.radii))
    return linked(strength, config.low, config.high, config.min_length), orientation


def thinned(across: np.ndarray, down: np.ndarray, least: float) -> np.ndarray:
    """(H, W) bool: where a gradient (H, W) is at least `least` long and longest along its direction (Canny)."""
    scale = UNITS / least
    dx, dy = (np.clip(part * scale, -32000, 32000).astype(np.int16) for part in (across, down))
    return cv2.Canny(dx, dy, UNITS, UNITS, L2gradient=True) > 0


def linked(strength: np.ndarray, low: float, high: float, min_length: int) -> np.ndarray:
    """(H, W) bool: 8-connected points of at least `low` that are `min_length` or more and reach `high` somewhere."""
    is_edge = np.asarray(strength >= low)
    count, piece = cv2.connectedComponents(is_edge.astype(np.uint8), connectivity=8)
    rows, columns = np.nonzero(is_edge)
    owner = np.asarray(piece, np.int32)[rows, columns]
    is_kept = np.bincount(owner, minlength=count) >= min_length
    is_kept &= np.bincount(owner[strength[rows, columns] >= high], minlength=count) > 0
    is_edge[rows, columns] = is_kept[owner]
    return is_edge


def steadied(across: np.ndarray, down: np.ndarray, sigma: float) -> np.ndarray:
    """(H, W, 2) float32 vector of twice the angle of a gradient (H, W) or (H, W, channels), a mean along the edge.

    Twice, because opposite gradients cross edges of the same orientation. Rims are stairs of pixels: without the mean,
    by a Gaussian of `sigma` pixels, the orientation would waver from step to step.
    """
    vector = np.stack([across**2 - down**2, 2.0 * across * down], axis=-1)
    return cv2.GaussianBlur(vector if across.ndim == 2 else vector.sum(axis=2), (0, 0), sigma)


def _gradient_squared(lab: np.ndarray) -> np.ndarray:
    """(h, w, 2) float32 direction of the largest change of colour, as `steadied` (Di Zenzo); the few pixels of the
    finest half-discs would round it to their own grid.
    """
    smooth = cv2.GaussianBlur(lab, (0, 0), BLUR)
    across, down = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3), cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3)
    return steadied(across, down, BLUR)


@lru_cache(maxsize=16)
def half_discs(radius: int) -> np.ndarray:
    """(DIRECTIONS, 2 radius + 1, 4) int64: of every row of a disc, the first and end column of either half.

    The line between the halves of number k is at right angles to k pi / DIRECTIONS from the x axis towards y; the first
    half lies in that direction. Columns count from the disc's middle; an empty run begins and ends at 0.
    """
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    is_inside = x * x + y * y <= radius * radius + 0.5
    runs = np.zeros((DIRECTIONS, 2 * radius + 1, 4), np.int64)
    for k, angle in enumerate(np.arange(DIRECTIONS) * np.pi / DIRECTIONS):
        side = x * np.cos(angle) + y * np.sin(angle)
        for first, half in ((0, is_inside & (side > ON_LINE)), (2, is_inside & (side < -ON_LINE))):
            for row in np.flatnonzero(half.any(axis=1)):
                columns = x[row, half[row]]
                runs[k, row, first : first + 2] = columns[0], columns[-1] + 1
    return runs


def _row_sums(lab: np.ndarray, pad: int) -> np.ndarray:
    """(4, rows + 2 pad, columns + 2 pad + 1) float32: sums along rows, up to a column, of Lab and of its square."""
    padded = cv2.copyMakeBorder(lab - lab.mean(axis=(0, 1)), pad, pad, pad, pad, cv2.BORDER_REFLECT)
    sums = np.zeros((4, padded.shape[0], padded.shape[1] + 1), np.float32)
    np.cumsum(padded.transpose(2, 0, 1), axis=2, out=sums[:3, :, 1:])
    np.cumsum((padded**2).sum(axis=2), axis=1, out=sums[3, :, 1:])
    return sums


@njit(cache=True, nogil=True, fastmath=True)
def _contrast(sums, runs, pad):
    """(rows, columns) float32: largest difference of the means over all directions."""
    directions, side, _ = runs.shape
    rows, columns = sums.shape[1] - 2 * pad, sums.shape[2] - 1 - 2 * pad
    out = np.zeros((rows, columns), np.float32)
    difference = np.empty((3, columns), np.float32)
    for y in range(rows):
        for k in range(directions):
            difference[:] = np.float32(0)
            pixels = 0
            for j in range(side):
                start, end, other_start, other_end = runs[k, j]
                pixels += end - start
                for c in range(3):
                    row, into = sums[c, y + pad - side // 2 + j], difference[c]
                    plus, minus = row[pad + end :], row[pad + start :]
                    other_plus, other_minus = row[pad + other_end :], row[pad + other_start :]
                    for x in range(columns):
                        into[x] += plus[x] - minus[x] - other_plus[x] + other_minus[x]
            share = np.float32(1.0 / pixels**2)
            for x in range(columns):
                squared = difference[0, x] ** 2 + difference[1, x] ** 2 + difference[2, x] ** 2
                out[y, x] = max(out[y, x], share * squared)
    return np.sqrt(out)


@njit(cache=True, nogil=True)
def _contrast_at(sums, runs, pad, texture, ys, xs, orientation):
    """(P,) float32 contrast, less for scattered colours, at points of the full image in their own directions."""
    directions, side, _ = runs.shape
    out = np.empty(len(ys), np.float32)
    for i in range(len(ys)):
        k = int(np.floor(orientation[i] / np.pi * directions + 0.5)) % directions
        top, left = ys[i] // 2 + pad - side // 2, xs[i] // 2 + pad
        squared, scatter = 0.0, 0.0
        for c in range(4):
            first, second, pixels = 0.0, 0.0, 0
            for j in range(side):
                start, end, other_start, other_end = runs[k, j]
                pixels += end - start
                first += sums[c, top + j, left + end] - sums[c, top + j, left + start]
                second += sums[c, top + j, left + other_end] - sums[c, top + j, left + other_start]
            first, second = first / pixels, second / pixels
            if c < 3:
                squared += (first - second) ** 2
                scatter -= first**2 + second**2
            else:
                scatter += first + second
        out[i] = np.sqrt(squared / (1.0 + max(scatter, 0.0) / texture))
    return out
