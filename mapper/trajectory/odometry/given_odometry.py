"""Camera motion from poses that somebody else estimated: the dataset's, or a trajectory file's."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....datasets.errors import InputError
from ....datasets.frame import BrokenFrame, Frame, FrameProblem
from ....datasets.poses import MAX_INTERPOLATION_GAP, MAX_STAMP_DIFFERENCE, StampedPoses, read_tum_poses
from ...config import OdometryConfig
from ..rigid import pose_covariance
from .odometry import KeyframeSteps, OdometryStep, Tracking, TrackingOutcome


class PoseOdometry:
    """The dataset's own poses taken as measurements; the world is the dataset's."""

    def __init__(self, config: OdometryConfig) -> None:
        self._covariance = 2.0 * pose_covariance(config.pose_sigma)  # both ends are measured
        self._keyframes = KeyframeSteps(config.covariance_floor, config.drift)
        self._T = np.eye(4)

    def register(self, frame: Frame, guess: np.ndarray | None = None) -> Tracking:
        """The frame's pose; a guess changes nothing."""
        if frame.T_world_camera is None:
            raise BrokenFrame(frame.name, FrameProblem.MISSING_POSE)
        self._T = frame.T_world_camera
        return Tracking(self._T, TrackingOutcome.GOOD)

    def keyframe(self) -> OdometryStep | None:
        return self._keyframes.step(self._T, self._covariance)


class TrajectoryOdometry:
    """A trajectory in the TUM format from any other system, taken as odometry: its steps count, its world does not.

    Poses are looked up by stamp as `StampedPoses.at` does it: between two rows at most 0.1 s apart, else the nearest
    row within 0.02 s. A frame without one is broken. A file states no noise: `path_sigma` and `path_drift` do.

    Raises:
        InputError: `config.path` is no such file.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._trajectory = read_tum_poses(Path(config.path))
        self._keyframes = KeyframeSteps(config.path_sigma, config.path_drift)
        self._T = np.eye(4)

    def register(self, frame: Frame, guess: np.ndarray | None = None) -> Tracking:
        """The trajectory's pose at the frame's stamp; a guess changes nothing."""
        T = self._trajectory.at(np.array([frame.stamp]))[0]
        if np.isnan(T[0, 0]):
            raise BrokenFrame(frame.name, FrameProblem.MISSING_POSE, _why(self._trajectory.stamps, frame.stamp))
        self._T = T
        return Tracking(T, TrackingOutcome.GOOD)

    def keyframe(self) -> OdometryStep | None:
        return self._keyframes.step(self._T, np.zeros((6, 6)))


def check_trajectory(path: Path, stamps: np.ndarray) -> None:
    """That a trajectory file has a pose for at least one of a sequence's (N,) stamps, seconds.

    Raises:
        InputError: it has none, or the file is no trajectory.
    """
    trajectory: StampedPoses = read_tum_poses(path)
    if np.isfinite(trajectory.at(stamps)[:, 0, 0]).any():
        return
    expected = (
        f"poses at the stamps of the sequence, {stamps[0]:.6f} to {stamps[-1]:.6f} s" if len(stamps) else "frames"
    )
    of = trajectory.stamps
    found = f"stamps {of[0]:.6f} to {of[-1]:.6f} s, none within {MAX_STAMP_DIFFERENCE} s" if len(of) else "no pose"
    raise InputError(path, expected, found, "give a trajectory of this recording, by the same clock, in seconds")


def _why(stamps: np.ndarray, stamp: float) -> str:
    """What a trajectory has around a stamp at which it has no pose."""
    after = int(np.searchsorted(stamps, stamp))
    if after in (0, len(stamps)):
        return "before or after the trajectory"
    return f"{stamps[after] - stamps[after - 1]:.2f} s between its neighbours, more than {MAX_INTERPOLATION_GAP} s"
