"""The coloured cloud of what has been seen, anchored to keyframes so that it moves when the graph moves."""

from __future__ import annotations

import numpy as np
from numba import njit

from ...datasets.frame import Frame
from ...datasets.lidar import point_colors
from ..config import CloudConfig

EMPTY = np.int64(-1)
KEY_BITS = 21  # per axis: 2 million voxels, 40 km at 2 cm
KEY_OFFSET = 1 << (KEY_BITS - 1)


class KeyframeCloud:
    """Points of keyframes, one per voxel of the world as it was estimated then; memory grows with the space seen."""

    def __init__(self, config: CloudConfig) -> None:
        self._config = config
        self._table = np.full(1 << 16, EMPTY)
        self._count = 0
        self._points: list[np.ndarray] = []
        self._colors: list[np.ndarray] = []
        self._keyframes: list[int] = []

    def add(self, frame: Frame, keyframe: int, T_world_camera: np.ndarray) -> None:
        """Adds the points of a keyframe that lie in voxels without one."""
        c = self._config
        points, colors = _scan_points(frame, c) if frame.scan is not None else _pixel_points(frame, c)
        keys = voxel_keys(points @ T_world_camera[:3, :3].T + T_world_camera[:3, 3], c.voxel_size)
        if 2 * (self._count + len(keys)) > len(self._table):
            self._table = _grown(self._table, 2 * (self._count + len(keys)))
        new = _insert(self._table, keys)
        self._count += int(new.sum())
        self._points.append(points[new].astype(np.float32))
        self._colors.append(colors[new])
        self._keyframes.append(keyframe)

    def rebuild(self, T_world_keyframe: np.ndarray) -> None:
        """Poses were corrected, (M, 4, 4): what now lies in a voxel with an older keyframe's point goes.

        A surface that was seen from wrong poses is there twice until then, and its old place closed to new points.
        1 million points take 0.3 s.
        """
        self._table, self._count = np.full_like(self._table, EMPTY), 0
        for i, keyframe in enumerate(self._keyframes):
            R, t = T_world_keyframe[keyframe][:3, :3], T_world_keyframe[keyframe][:3, 3]
            first = _insert(self._table, voxel_keys(self._points[i] @ R.T + t, self._config.voxel_size))
            self._points[i], self._colors[i] = self._points[i][first], self._colors[i][first]
            self._count += int(first.sum())

    def assemble(self, T_world_keyframe: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) float32 points, world, metres, and (N, 3) uint8 RGB, under the given (M, 4, 4) keyframe poses."""
        if not self._points:
            return np.empty((0, 3), dtype=np.float32), np.empty((0, 3), dtype=np.uint8)
        moved = [
            points @ T_world_keyframe[t][:3, :3].T.astype(np.float32) + T_world_keyframe[t][:3, 3].astype(np.float32)
            for t, points in zip(self._keyframes, self._points, strict=True)
        ]
        return np.concatenate(moved), np.concatenate(self._colors)


def _pixel_points(frame: Frame, config: CloudConfig) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) points of a depth image within range, camera frame, and (N, 3) uint8 RGB."""
    depth = frame.depth[:: config.pixel_step, :: config.pixel_step]
    v, u = np.nonzero((depth > 0.0) & (depth < config.max_range))
    uv = np.stack([u, v], axis=1) * config.pixel_step
    return frame.intrinsics.back_project(uv, depth[v, u].astype(np.float64)), frame.color[uv[:, 1], uv[:, 0]]


def _scan_points(frame: Frame, config: CloudConfig) -> tuple[np.ndarray, np.ndarray]:
    """The same of a LiDAR's scan, of all around; its depth image is spread and would show plates."""
    assert frame.scan is not None
    points = frame.scan.camera_points()
    near = np.linalg.norm(points, axis=1) < config.max_range
    return points[near], point_colors(frame)[near]


def voxel_keys(points: np.ndarray, size: float) -> np.ndarray:
    """(N, 3) points to (N,) int64, one number a voxel."""
    cells = np.floor(points / size).astype(np.int64) + KEY_OFFSET
    return (cells[:, 0] << (2 * KEY_BITS)) | (cells[:, 1] << KEY_BITS) | cells[:, 2]


@njit(cache=True)
def _insert(table, keys):
    """Open addressing: True for the keys that were not yet in the table, which now holds them."""
    mask = len(table) - 1
    new = np.zeros(len(keys), dtype=np.bool_)
    for i in range(len(keys)):
        key = keys[i]
        slot = ((key * np.int64(-7046029254386353131)) >> np.int64(40)) & mask
        while table[slot] != EMPTY and table[slot] != key:
            slot = (slot + 1) & mask
        if table[slot] == EMPTY:
            table[slot] = key
            new[i] = True
    return new


def _grown(table: np.ndarray, at_least: int) -> np.ndarray:
    bigger = np.full(1 << int(np.ceil(np.log2(2 * at_least))), EMPTY)
    _insert(bigger, table[table != EMPTY])
    return bigger
