"""A keyframe as it is being added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...datasets.frame import Frame


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A keyframe, its place and the frame of the object volumes.

    Attributes:
        frame: its images.
        keyframe: its number in the graph.
        T_world_camera: (4, 4) predicted pose.
        R_world_upright: (3, 3) frame of the object volumes.
        placed: whether it is known where the camera is; otherwise nothing that it sees can be told from what is known.
    """

    frame: Frame
    keyframe: int
    T_world_camera: np.ndarray
    R_world_upright: np.ndarray
    placed: bool = True

    def to_world(self, points: np.ndarray) -> np.ndarray:
        """(3,) or (N, 3) camera-frame points to world, metres."""
        return points @ self.T_world_camera[:3, :3].T + self.T_world_camera[:3, 3]

    def covariance_to_world(self, covariance: np.ndarray) -> np.ndarray:
        """(3, 3) camera-frame covariance to world."""
        R = self.T_world_camera[:3, :3]
        return R @ covariance @ R.T
