"""Camera motion from poses that somebody else estimated."""

from __future__ import annotations

import numpy as np

from ...datasets.frame import BrokenFrame, Frame, FrameProblem
from ..config import OdometryConfig
from .odometry import KeyframeSteps, OdometryStep, Tracking, TrackingOutcome


class PoseOdometry:
    """The dataset's own poses taken as measurements; the world is the dataset's."""

    def __init__(self, config: OdometryConfig) -> None:
        sigma_r, sigma_t = config.pose_sigma
        self._covariance = 2.0 * np.diag(np.repeat([sigma_r**2, sigma_t**2], 3))  # both ends are measured
        self._keyframes = KeyframeSteps(config)
        self._T = np.eye(4)

    def register(self, frame: Frame) -> Tracking:
        if frame.T_world_camera is None:
            raise BrokenFrame(frame.name, FrameProblem.MISSING_POSE)
        self._T = frame.T_world_camera
        return Tracking(self._T, TrackingOutcome.GOOD)

    def keyframe(self) -> OdometryStep | None:
        return self._keyframes.step(self._T, self._covariance)
