"""What the second stage sees of a window: the pyramid's features and depth, at one grid whatever the window's size.

A linear template weighs the cells of its own class's window. Here the windows of all classes are described alike, and
with depth itself: its shape against the window's middle, and how large in metres what it shows is.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
from numba import njit
from scipy.special import logit

from ..candidates import Candidates
from ..channels import CELL
from ..pyramid import Pyramid

CELLS = 6  # of the grid of features, on a side
PIXELS = 14  # of the patch of depth, on a side
ROOM = 1.25  # sides of what is looked at, over the window's: an outline needs both of its sides
FAR_APART = 2.0  # sizes of the window beyond which depth differs without saying more
DISTANCE = 1.5  # m, of a window without a reading in its middle
SCALARS = 5  # log of width and height in metres, distance, whether it is known, log odds of the template


def view_size(channels: int, classes: int) -> int:
    """F, how many numbers describe a window, for features of so many channels and K classes."""
    return CELLS * CELLS * channels + 2 * PIXELS * PIXELS + SCALARS + classes


def window_views(pyramid: Pyramid, depth: np.ndarray, focal: float, windows: Candidates, classes: int) -> np.ndarray:
    """The descriptions of N windows of an image.

    Args:
        pyramid: of the image, with at least one level if there are windows.
        depth: (H, W) metres; 0 or not finite where nothing was read, which counts as such.
        focal: pixels.
        windows: with their boxes, classes and probabilities by the templates.
        classes: K of the model.

    Returns:
        (N, F) float32, F as `view_size` says: features of a grid over the box and some room around it, taken from the
        level whose cells fit it best; depth less that of the middle, in sizes of the window, and where it is known, of
        a finer grid; width, height (log metres) and distance (metres) of the box; the template's log odds and class.
    """
    boxes = _with_room(windows.xyxy)
    cells = _grid_of_features(pyramid, boxes)
    seen = _grid_of_depth(np.ascontiguousarray(depth, dtype=np.float32), boxes)
    distance, known = _distance(seen)
    sides = (windows.xyxy[:, 2:] - windows.xyxy[:, :2]) * (distance / focal)[:, None]
    size = np.sqrt(sides.prod(axis=1))
    relative = np.clip((seen - distance[:, None, None]) / size[:, None, None], -FAR_APART, FAR_APART)
    is_read = seen > 0.0
    likely = logit(np.clip(windows.probability, 1e-9, 1.0 - 1e-9))
    parts = (
        _flat(cells),
        _flat(np.where(is_read, relative, 0.0)),
        _flat(is_read),
        np.log(sides),
        np.column_stack([distance, known, likely]),
        np.eye(classes)[windows.class_id],
    )
    return np.concatenate(parts, axis=1, dtype=np.float32)


def _flat(array: np.ndarray) -> np.ndarray:
    return array.reshape(len(array), math.prod(array.shape[1:]))


def _with_room(xyxy: np.ndarray) -> np.ndarray:
    centre, half = 0.5 * (xyxy[:, :2] + xyxy[:, 2:]), 0.5 * ROOM * (xyxy[:, 2:] - xyxy[:, :2])
    return np.concatenate([centre - half, centre + half], axis=1)


def _grid_of_features(pyramid: Pyramid, boxes: np.ndarray) -> np.ndarray:
    """(N, CELLS, CELLS, C) float32, between the cells of a level bilinearly, beyond its border those of the border."""
    channels = pyramid.levels[0].features.shape[2] if pyramid.levels else 0
    found = np.empty((len(boxes), CELLS, CELLS, channels), np.float32)
    if not len(boxes):
        return found
    side = np.sqrt((boxes[:, 2:] - boxes[:, :2]).prod(axis=1))
    scales = np.log([level.scale for level in pyramid.levels])
    best = np.abs(scales[None] - np.log(CELL * CELLS / side)[:, None]).argmin(axis=1)
    for number in np.unique(best):
        level, rows = pyramid.levels[number], np.flatnonzero(best == number)
        found[rows] = _sampled(level.features, boxes[rows] * (level.scale / CELL) + level.border)
    return found


@njit(cache=True, nogil=True)
def _sampled(features, boxes):  # pragma: no cover
    """Of (h, w, C) features at the middles of grids over (N, 4) boxes in cells."""
    h, w, channels = features.shape
    out = np.empty((len(boxes), CELLS, CELLS, channels), np.float32)
    for n in range(len(boxes)):
        x0, y0, x1, y1 = boxes[n]
        for a in range(CELLS):
            y = min(max(y0 + (a + 0.5) * (y1 - y0) / CELLS - 0.5, 0.0), h - 1.0)
            i = min(int(y), max(h - 2, 0))
            below, down = min(i + 1, h - 1), np.float32(y - i)
            for b in range(CELLS):
                x = min(max(x0 + (b + 0.5) * (x1 - x0) / CELLS - 0.5, 0.0), w - 1.0)
                j = min(int(x), max(w - 2, 0))
                beside, right = min(j + 1, w - 1), np.float32(x - j)
                for c in range(channels):
                    upper = features[i, j, c] + right * (features[i, beside, c] - features[i, j, c])
                    lower = features[below, j, c] + right * (features[below, beside, c] - features[below, j, c])
                    out[n, a, b, c] = upper + down * (lower - upper)
    return out


@njit(cache=True, nogil=True)
def _grid_of_depth(depth, boxes):  # pragma: no cover
    """(N, PIXELS, PIXELS) metres of the pixels at the middles of grids over (N, 4) boxes; 0 where nothing was read."""
    height, width = depth.shape
    out = np.zeros((len(boxes), PIXELS, PIXELS), np.float32)
    for n in range(len(boxes)):
        for a in range(PIXELS):
            y = int(np.floor(boxes[n, 1] + (a + 0.5) * (boxes[n, 3] - boxes[n, 1]) / PIXELS))
            for b in range(PIXELS):
                x = int(np.floor(boxes[n, 0] + (b + 0.5) * (boxes[n, 2] - boxes[n, 0]) / PIXELS))
                if 0 <= y < height and 0 <= x < width and 0.0 < depth[y, x] < np.inf:
                    out[n, a, b] = depth[y, x]
    return out


def _distance(depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) metres, the median of the readings in the middle (half the sides) of (N, h, w) depth, and whether any is."""
    quarter = PIXELS // 4
    middle = depth[:, quarter : PIXELS - quarter, quarter : PIXELS - quarter]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # no reading at all
        median = np.nanmedian(np.where(middle > 0.0, middle, np.nan), axis=(1, 2))
    known = np.isfinite(median)
    return np.where(known, median, DISTANCE), known
