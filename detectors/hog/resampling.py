"""Images at other scales: every new pixel is the mean of the part of the image that it covers."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def resampled(planes, x0, y0, scale_x, scale_y, width, height):
    """A part of an image at another scale; beyond the image its edge goes on.

    Args:
        planes: (C, H, W) float32.
        x0, y0: the part's upper left corner, pixels of the image from its outer edge; may lie outside.
        scale_x, scale_y: new pixels per old one. Above 1 the image turns blocky.
        width, height: of the result, new pixels.

    Returns:
        (C, height, width) float32.
    """
    left, weight_x = _cover(x0, scale_x, width)
    top, weight_y = _cover(y0, scale_y, height)
    count, rows, columns = planes.shape
    out = np.empty((count, height, width), np.float32)
    line = np.empty(columns, np.float32)
    for c in range(count):
        for v in range(height):
            line[:] = np.float32(0.0)
            for k in range(weight_y.shape[1]):
                weight = weight_y[v, k]
                if weight > 0.0:
                    source = planes[c, min(max(top[v] + k, 0), rows - 1)]
                    for x in range(columns):
                        line[x] += weight * source[x]
            for u in range(width):
                total = np.float32(0.0)
                for k in range(weight_x.shape[1]):
                    total += weight_x[u, k] * line[min(max(left[u] + k, 0), columns - 1)]
                out[c, v, u] = total
    return out


@njit(cache=True, nogil=True)
def _cover(start, scale, count):
    """For every new pixel the first old one that it covers, and the share of it that each one from there on takes."""
    first = np.empty(count, np.int64)
    share = np.zeros((count, int(np.ceil(1.0 / scale)) + 1), np.float32)
    for i in range(count):
        # rounded, so that a pixel's edge that falls on another's does not take a sliver of the next
        a = np.round((start + i / scale) * 1e6) / 1e6
        b = np.round((start + (i + 1) / scale) * 1e6) / 1e6
        first[i] = int(np.floor(a))
        for k in range(share.shape[1]):
            overlap = min(b, first[i] + k + 1.0) - max(a, first[i] + k)
            share[i, k] = max(overlap, 0.0) / (b - a)
    return first, share


@njit(cache=True, nogil=True)
def nearest(image, x0, y0, scale_x, scale_y, width, height):
    """The same part of an image (H, W), but every new pixel is the old one at its middle: depth must not be mixed."""
    rows, columns = image.shape
    out = np.empty((height, width), image.dtype)
    for v in range(height):
        y = min(max(int(np.floor(y0 + (v + 0.5) / scale_y + 1e-6)), 0), rows - 1)
        for u in range(width):
            x = min(max(int(np.floor(x0 + (u + 0.5) / scale_x + 1e-6)), 0), columns - 1)
            out[v, u] = image[y, x]
    return out
