"""Which frames become keyframes, and where every frame was."""

from __future__ import annotations

import numpy as np

from ..config import KeyframeConfig
from .rigid import inverse, rotation_angle


class KeyframeSelector:
    """A frame is a keyframe when the camera has moved enough since the last one, or after a while."""

    def __init__(self, config: KeyframeConfig) -> None:
        self._config = config
        self._T_last: np.ndarray | None = None
        self._since = 0

    def is_keyframe(self, T: np.ndarray) -> bool:
        """`T`: (4, 4) odometry pose of this frame. Remembers it when the answer is yes."""
        self._since += 1
        if self._T_last is not None and not self._moved(inverse(self._T_last) @ T):
            return False
        self._T_last, self._since = T, 0
        return True

    def _moved(self, T_last_now: np.ndarray) -> bool:
        c = self._config
        return (
            float(np.linalg.norm(T_last_now[:3, 3])) > c.translation
            or rotation_angle(T_last_now[:3, :3]) > c.rotation
            or self._since >= c.max_gap
        )


class FrameTrajectory:
    """Every processed frame, anchored to the keyframe before it, so that it moves when the graph moves."""

    def __init__(self) -> None:
        self._stamps: list[float] = []
        self._keyframe_stamps: list[float] = []
        self._keyframe: list[int] = []
        self._T_keyframe_camera: list[np.ndarray] = []
        self._T_odometry_keyframe = np.eye(4)

    def __len__(self) -> int:
        return len(self._stamps)

    def append(self, stamp: float, T_odometry_camera: np.ndarray, keyframe: int, is_keyframe: bool) -> np.ndarray:
        """Adds a frame seen from (or being) keyframe number `keyframe`; returns (4, 4) `T_keyframe_camera`."""
        if is_keyframe:
            self._T_odometry_keyframe = T_odometry_camera
            self._keyframe_stamps.append(stamp)
        T = inverse(self._T_odometry_keyframe) @ T_odometry_camera
        self._stamps.append(stamp)
        self._keyframe.append(keyframe)
        self._T_keyframe_camera.append(T)
        return T

    def keyframe_stamps(self) -> np.ndarray:
        """(M,) seconds: when each keyframe was taken."""
        return np.array(self._keyframe_stamps)

    def poses(self, T_world_keyframe: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N,) stamps and (N, 4, 4) `T_world_camera` under the given (M, 4, 4) keyframe poses."""
        if not self._stamps:
            return np.empty(0), np.empty((0, 4, 4))
        return np.array(self._stamps), T_world_keyframe[self._keyframe] @ np.array(self._T_keyframe_camera)
