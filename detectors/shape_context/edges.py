"""One map of an image's edges: where depth jumps, and where only colours differ (Georgakis et al., section III-A)."""

from __future__ import annotations

import cv2
import numpy as np

from .boundaries import color_boundaries
from .depth_edges import depth_edges, inverse_depth, readings, square
from .edge_config import EdgeConfig
from .edge_map import EdgeMap

Images = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]

SURROUNDINGS = 16  # pixels around the asked-for part that filters look at, beyond their own reach
DESPECKLING = 3  # pixels, side of the median before the nearest surface is taken


def find_edges(
    color: np.ndarray, depth: np.ndarray, config: EdgeConfig | None = None, within: np.ndarray | None = None
) -> EdgeMap:
    """Edges of an image, one pixel wide; the same image gives the same ones.

    Args:
        color: (H, W, 3) uint8, RGB.
        depth: (H, W) metres, registered to colour; no reading where it is not finite, or below 1 cm.
        config: all numbers.
        within: (H, W) bool, the part whose edges are asked for, those at its rim included; None = everywhere. Lines
            that lead far out of it are cut, and so may be found too short, or too weak.

    Raises:
        ValueError: the images differ in size or are not of this kind.
    """
    config = EdgeConfig() if config is None else config
    _check(color, depth, within)
    shape = depth.shape
    rows, columns = slice(0, shape[0]), slice(0, shape[1])
    if within is not None:
        rows, columns = _part(within, config)
    if depth[rows, columns].size == 0:
        nothing = np.zeros((0, 0), np.float32)
        return _put_back(shape, rows, columns, (nothing > 0, nothing > 0, nothing, nothing))
    if within is not None:
        within = cv2.dilate(within[rows, columns].astype(np.uint8), square(config.margin)) > 0
    return _put_back(shape, rows, columns, _edges_of(color[rows, columns], depth[rows, columns], config), within)


def _edges_of(color: np.ndarray, depth: np.ndarray, config: EdgeConfig) -> Images:
    """Four of (H, W): is an edge, is one of depth, direction across, metres of the nearest surface around."""
    depth = np.ascontiguousarray(depth, np.float32)
    inverse = inverse_depth(depth, config.depth)
    is_depth, direction = depth_edges(depth, config.depth, inverse)
    is_color, color_direction = color_boundaries(np.ascontiguousarray(color), config.boundaries)
    is_color &= cv2.dilate(is_depth.astype(np.uint8), square(config.merging)) == 0
    direction = np.where(is_depth, direction, color_direction)
    return is_depth | is_color, is_depth, direction, _nearest(depth, inverse, config.nearest)


def _nearest(depth: np.ndarray, inverse: np.ndarray, reach: int) -> np.ndarray:
    """(H, W) float32 metres of the nearest surface of a window, 0 where nothing in it was measured."""
    near = cv2.dilate(cv2.medianBlur(inverse, DESPECKLING), square(reach))
    is_read = cv2.dilate(readings(depth).astype(np.uint8), square(reach)) > 0
    out = np.zeros(depth.shape, np.float32)
    np.divide(1.0, near, out=out, where=is_read)
    return out


def _put_back(
    shape: tuple[int, int],
    rows: slice,
    columns: slice,
    images: Images,
    within: np.ndarray | None = None,
) -> EdgeMap:
    """The points of a part of an image, as points of the whole."""
    is_edge, is_depth, direction, nearest = images
    if within is not None:
        is_edge = is_edge & within
    y, x = np.nonzero(is_edge)
    orientation = np.mod(direction[y, x], np.float32(np.pi)).astype(np.float32)
    orientation[orientation >= np.pi] = 0.0  # what rounds up to pi
    counts = np.bincount(y + rows.start, minlength=shape[0])
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    places = (x + columns.start).astype(np.int32), (y + rows.start).astype(np.int32)
    return EdgeMap(shape, *places, start, orientation, nearest[y, x], is_depth[y, x])


def _part(within: np.ndarray, config: EdgeConfig) -> tuple[slice, slice]:
    """Rows and columns around all of `within`, with what filters need beside it; empty where nothing is asked for."""
    around = SURROUNDINGS + config.margin + config.boundaries.radii[-1]
    sides = []
    for axis, size in ((1, within.shape[0]), (0, within.shape[1])):
        on = np.flatnonzero(within.any(axis=axis))
        if not len(on):
            return slice(0, 0), slice(0, 0)
        first = max(int(on[0]) - around, 0)
        first -= first % 2  # the half-size image of a part is then a part of the half-size image
        sides.append(slice(first, min(int(on[-1]) + 1 + around, size)))
    return sides[0], sides[1]


def _check(color: np.ndarray, depth: np.ndarray, within: np.ndarray | None) -> None:
    if depth.ndim != 2 or color.shape != (*depth.shape, 3) or color.dtype != np.uint8:
        raise ValueError(
            f"color must be (H, W, 3) uint8 and depth (H, W), but are {color.shape} {color.dtype} and {depth.shape}"
        )
    if within is not None and (within.shape != depth.shape or within.dtype != bool):
        raise ValueError(f"within must be {depth.shape} bool, but is {within.shape} {within.dtype}")
