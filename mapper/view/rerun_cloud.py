"""The cloud as it grows: what is new in a keyframe becomes an entity that hangs on that keyframe's pose."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...datasets.frame import Frame
from ...datasets.lidar import point_colors
from ..config import CloudConfig
from ..trajectory.cloud import voxel_keys
from .rerun_package import import_rerun

CLOUD = "world/cloud"
MAX_POINTS = 400_000  # in all: a viewer in a browser turns them smoothly
FEW = 50  # new points below which a keyframe gets no entity of its own; they are new to the next one still
POINT_RADIUS = 0.5  # voxels


class GrowingCloud:
    """Points of keyframes that lie where no earlier one had any; a correction moves entities and sends no points.

    Args:
        recording: where to.
        config: of the map's cloud, whose voxels and range these are.
    """

    def __init__(self, recording: Any, config: CloudConfig) -> None:
        self._rr, self._recording, self._config = import_rerun(), recording, config
        self._taken = np.empty(0, dtype=np.int64)  # voxels, in order
        self._anchored: set[int] = set()  # keyframes with points

    def __len__(self) -> int:
        """Points so far."""
        return len(self._taken)

    def add(self, frame: Frame, keyframe: int, T_world_camera: np.ndarray) -> None:
        """Draws what the (4, 4) posed keyframe shows of places that were empty."""
        if len(self) >= MAX_POINTS:
            return
        points, colors = self._points(frame)
        keys = voxel_keys(points @ T_world_camera[:3, :3].T + T_world_camera[:3, 3], self._config.voxel_size)
        keys, first = np.unique(keys, return_index=True)
        place = np.searchsorted(self._taken, keys)
        known = np.zeros(len(keys), dtype=bool)
        inside = place < len(self._taken)
        known[inside] = self._taken[place[inside]] == keys[inside]
        new = np.flatnonzero(~known)[: MAX_POINTS - len(self)]
        if len(new) < FEW:
            return
        self._taken = np.insert(self._taken, place[new], keys[new])
        shapes = self._rr.Points3D(points[first[new]].astype(np.float32), colors=colors[first[new]], radii=self._radius)
        self._anchored.add(keyframe)
        self._recording.log(_entity(keyframe), self._pose(T_world_camera), shapes)

    def follow(self, moved: np.ndarray, T_world_keyframe: np.ndarray) -> None:
        """Moves the points of those keyframes that have moved: (M,) bool, (M, 4, 4)."""
        for keyframe in np.flatnonzero(moved):
            if int(keyframe) in self._anchored:
                self._recording.log(_entity(int(keyframe)), self._pose(T_world_keyframe[keyframe]))

    @property
    def _radius(self) -> float:
        return POINT_RADIUS * self._config.voxel_size

    def _pose(self, T_world_camera: np.ndarray) -> Any:
        return self._rr.Transform3D(translation=T_world_camera[:3, 3], mat3x3=T_world_camera[:3, :3])

    def _points(self, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) camera-frame points within range, metres, and (N, 3) uint8 RGB."""
        if frame.scan is not None:
            points = frame.scan.camera_points()
            near = np.linalg.norm(points, axis=1) < self._config.max_range
            return points[near], point_colors(frame)[near]
        step = self._config.pixel_step
        depth = frame.depth[::step, ::step]
        v, u = np.nonzero((depth > 0.0) & (depth < self._config.max_range))
        points = frame.intrinsics.back_project(np.stack([u, v], axis=1) * step, depth[v, u].astype(np.float64))
        return points, frame.color[v * step, u * step]


def _entity(keyframe: int) -> str:
    return f"{CLOUD}/k{keyframe:06d}"
