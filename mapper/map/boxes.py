"""Upright boxes as geometry: corners, edges, and which points lie inside."""

from __future__ import annotations

import numpy as np

# Corners go round the bottom, then round the top in the same order, seen from above.
CORNER_SIGNS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
    dtype=np.float64,
)
EDGES = np.array(
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]],
    dtype=np.int32,
)


def box_axes(yaw: float, R_world_upright: np.ndarray) -> np.ndarray:
    """(3, 3) `R_world_box`: the upright frame turned by `yaw` radians about its z axis."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return R_world_upright @ np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def box_corners(position: np.ndarray, size: np.ndarray, yaw: float, R_world_upright: np.ndarray) -> np.ndarray:
    """(8, 3) corners in map coordinates, metres, in the order of `CORNER_SIGNS`; `EDGES` indexes them.

    `position` (3,) is the centre in metres, `size` (3,) the full extents along the box's own axes.
    """
    return position + (CORNER_SIGNS * (np.asarray(size) / 2.0)) @ box_axes(yaw, R_world_upright).T


def inside_box(
    points: np.ndarray, position: np.ndarray, size: np.ndarray, yaw: float, R_world_upright: np.ndarray
) -> np.ndarray:
    """(M,) bool: which of the (M, 3) points, map frame, metres, lie in the box or on its surface."""
    local = (points - position) @ box_axes(yaw, R_world_upright)
    return np.all(np.abs(local) <= np.asarray(size) / 2.0, axis=1)
