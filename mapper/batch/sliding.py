"""Sliding volumes: mean-size volumes of every class on a coarse grid over occupied space (Meger et al., Clutter, V).

Occupied space is where some view's depth readings lie. An object's centre lies behind its surface, so each reading
stands for the place half a volume behind it. A volume is kept if in some view it comes near a detection that may be
of its class, in the image and in depth: without one no image speaks for it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit

from ...datasets.frame import Intrinsics
from ...factors.size_prior import ClassSizePriors
from ...factors.solid import solid_kernel
from ..proposals.views import PackedViews
from ..proposals.volumes import Volumes

PIXEL_STEP = 4  # every 4th pixel of a depth map in both directions; own choice
VOXEL = 0.03  # m; readings in one voxel of space count once, whatever the view; a third of a cup's width
MAX_RANGE = 6.0  # m; beyond it depth readings are worse than 10 cm
MAX_SHIFT = 0.5  # of the detection's scale, between the two centres: the standard deviation of Clutter, III-D
MAX_LOG_RATIO = 0.7  # of the scales: the standard deviation of Clutter, III-D
CLASS_SHARE = 0.25  # of its best score: a detection may be of every class that scores so much


def slide_volumes(
    views: PackedViews,
    points: np.ndarray,
    scores: np.ndarray,
    priors: ClassSizePriors,
    spacing: float,
    gate: float,
) -> Volumes:
    """Hypotheses on a grid, of the classes that some detection may be of.

    Args:
        views: V views with D detections.
        points: (M, 6) world: occupied point and the camera's centre that saw it, metres (`occupied_points`).
        scores: (D, K), NaN where not reported.
        priors: of the classes' sizes; a class without one has no mean size, so no sliding volumes either.
        spacing: of a class's mean size, between neighbours along every axis.
        gate: chi-square, 3 degrees of freedom, of the place against a detection's depth centre.
    """
    best = np.nanmax(scores, axis=1, initial=0.0) if len(scores) else np.empty(0)
    may_be = np.nan_to_num(scores) >= np.maximum(CLASS_SHARE * best, 1e-9)[:, None]
    positions, sizes, classes = [], [], []
    for k in np.flatnonzero(may_be.any(axis=0) & priors.known):
        log_size = priors.mean[k + 1]
        centres = grid_centres(points, np.exp(log_size), views.R_world_upright, spacing)
        found = views.first, views.whole_xyxy, views.centre, views.gate_information
        camera = views.T_camera_rows, views.R_world_upright, views.camera
        near = _near_some_detection(*camera, found, np.ascontiguousarray(may_be[:, k]), gate, centres, log_size)
        positions.append(centres[near])
        sizes.append(np.tile(log_size, (int(near.sum()), 1)))
        classes.append(np.full(int(near.sum()), k, dtype=np.int64))
    if not positions:
        return Volumes(np.empty((0, 3)), np.empty((0, 3)), np.empty(0, dtype=np.int64))
    return Volumes(np.concatenate(positions), np.concatenate(sizes), np.concatenate(classes))


def occupied_points(depths: Sequence[np.ndarray], cameras: Sequence[np.ndarray], intrinsics: Intrinsics) -> np.ndarray:
    """(M, 6) world: a point in each occupied voxel of the depth maps (H, W), and the first camera to see it, m."""
    rows = [np.empty((0, 6))]
    for depth, T in zip(depths, cameras, strict=True):
        z = depth[::PIXEL_STEP, ::PIXEL_STEP]
        v, u = np.nonzero((z > 0.0) & (z < MAX_RANGE))
        uv = np.stack([u, v], axis=1).astype(float) * PIXEL_STEP
        points = intrinsics.back_project(uv, z[v, u].astype(float)) @ T[:3, :3].T + T[:3, 3]
        rows.append(np.hstack([points, np.broadcast_to(T[:3, 3], points.shape)]))
    seen = np.concatenate(rows)
    number = _cell_numbers(np.floor(seen[:, :3] / VOXEL).astype(np.int64))[0]
    return seen[np.unique(number, return_index=True)[1]]


def grid_centres(points: np.ndarray, half_axes: np.ndarray, R_world_upright: np.ndarray, spacing: float) -> np.ndarray:
    """(N, 3) world: centres of the grid's cells that hold the centre of a volume whose surface is one of the points.

    Args:
        points: (M, 6) as of `occupied_points`.
        half_axes: (3,) metres, upright frame.
        R_world_upright: (3, 3).
        spacing: of the volume's extents, of the grid's cells.
    """
    surface, ray = points[:, :3] @ R_world_upright, (points[:, :3] - points[:, 3:]) @ R_world_upright
    ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-9)
    radius = 1.0 / np.maximum(np.linalg.norm(ray / half_axes, axis=1, keepdims=True), 1e-9)
    cell = spacing * 2.0 * half_axes
    index = np.floor((surface + ray * radius) / cell).astype(np.int64)
    number, low, extent = _cell_numbers(index)
    cells = np.stack(np.unravel_index(np.unique(number), extent), axis=1) + low
    return np.ascontiguousarray(((cells + 0.5) * cell) @ R_world_upright.T)


def _cell_numbers(index: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple[int, ...]]:
    """(M,) one number for each (M, 3) cell, faster to make unique than three; lowest cell and extent to undo it."""
    low = index.min(axis=0, initial=0)
    extent = tuple(int(n) for n in index.max(axis=0, initial=0) - low + 1)
    return np.asarray(np.ravel_multi_index(tuple((index - low).T), extent)), low, extent


@njit(cache=True)
def _near_some_detection(T_rows, R, camera, found, may_be, gate, centres, log_size):
    """(N,) bool, whether some view has a detection of the class near the volume."""
    first, whole, centre, information = found
    near, sides, unused = np.zeros(len(centres), np.bool_), np.empty(4), np.zeros((4, 12))
    for v in range(len(T_rows)):
        if not np.any(may_be[first[v] : first[v + 1]]):
            continue
        T = T_rows[v].T
        for n in range(len(centres)):
            if near[n] or not solid_kernel(T, R, centres[n], log_size, sides, unused, False):
                continue
            for side in range(4):
                sides[side] = camera[side % 2] * sides[side] + camera[2 + side % 2]
            for d in range(first[v], first[v + 1]):
                if may_be[d] and _is_near(sides, whole[d]):
                    away = centres[n] - centre[d]
                    if away @ information[d] @ away <= gate:
                        near[n] = True
                        break
    return near


@njit(cache=True)
def _is_near(sides, box):
    scale = np.sqrt((box[2] - box[0]) * (box[3] - box[1]))
    dx = 0.5 * (sides[0] + sides[2] - box[0] - box[2]) / scale
    dy = 0.5 * (sides[1] + sides[3] - box[1] - box[3]) / scale
    ratio = np.log(np.sqrt((sides[2] - sides[0]) * (sides[3] - sides[1])) / scale)
    return dx * dx + dy * dy <= MAX_SHIFT * MAX_SHIFT and abs(ratio) <= MAX_LOG_RATIO
