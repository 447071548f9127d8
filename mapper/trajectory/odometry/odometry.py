"""Camera motion from frame to frame, as measurements for the graph: what every odometry offers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from ....datasets.frame import Frame
from ..rigid import chi_square, inverse, pose_covariance, retracted, rotation_angle, tangent


class TrackingOutcome(Enum):
    """How well a frame's pose is held by what it shows."""

    GOOD = "good"
    DEGENERATE = "degenerate"  # the geometry leaves a direction open: it is taken from the image, else from the motion
    LOST = "lost"  # nothing fits; the pose is what the motion before would have led to


@dataclass(frozen=True, slots=True, eq=False)
class Tracking:
    """Where a frame was: (4, 4) `T_odometry_camera` in the odometry's own world, and how well that is known."""

    T_odometry_camera: np.ndarray
    outcome: TrackingOutcome


@dataclass(frozen=True, slots=True, eq=False)
class OdometryStep:
    """Motion between two keyframes.

    Attributes:
        T_a_b: (4, 4) camera b in camera a.
        covariance: (6, 6) in the right tangent of `T_a_b`, [rotation rad, translation m], GTSAM's order.
    """

    T_a_b: np.ndarray
    covariance: np.ndarray


def fused(
    T: np.ndarray, covariance: np.ndarray, T_other: np.ndarray, covariance_other: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The mean of two measurements of one motion, (4, 4) with (6, 6) in their right tangents, and its covariance."""
    information, other = np.linalg.inv(covariance), np.linalg.inv(covariance_other)
    return weighed(T, information, T_other, other), np.linalg.inv(information + other)


def weighed(T: np.ndarray, information: np.ndarray, T_other: np.ndarray, information_other: np.ndarray) -> np.ndarray:
    """The mean of two poses by their informations Lambda and W in the right tangent at T; one may be singular.

    d = Log(T^-1 T_other),     T Exp((Lambda + W)^-1 W d)
    """
    d = tangent(T, T_other)
    return retracted(T, np.linalg.solve(information + information_other, information_other @ d))


def widened(
    T: np.ndarray, covariance: np.ndarray, T_other: np.ndarray, covariance_other: np.ndarray, gate: float
) -> np.ndarray:
    """(6, 6) of a measurement; if it contradicts another of the same motion, wider by how far they are apart.

    Args:
        T, covariance: (4, 4), (6, 6) in its right tangent; the one in doubt.
        T_other, covariance_other: the one that is relied on.
        gate: chi-square of 6 degrees of freedom, up to which the two agree and nothing is changed.
    """
    if chi_square(T, T_other, covariance + covariance_other) <= gate:
        return covariance
    d = tangent(T, T_other)
    return covariance + np.outer(d, d)


class Odometry(Protocol):
    """Registers every frame; measures the motion between the frames that become keyframes."""

    def register(self, frame: Frame) -> Tracking:
        """Where this frame was.

        Raises:
            BrokenFrame: it cannot be used at all; the odometry is as before.
        """
        ...

    def keyframe(self) -> OdometryStep | None:
        """Makes the last registered frame a keyframe: the motion since the one before, or None for the first."""
        ...


class KeyframeSteps:
    """From poses of keyframes to the motion between them, with a covariance that grows with it.

    Args:
        floor: (rad, m) deviation of the shortest step.
        drift: its growth, rad per rad turned and m per m moved.
    """

    def __init__(self, floor: tuple[float, float], drift: tuple[float, float]) -> None:
        self._floor, self._drift = floor, drift
        self._T_last: np.ndarray | None = None

    def step(self, T: np.ndarray, covariance: np.ndarray) -> OdometryStep | None:
        """Motion to (4, 4) `T_odometry_camera` with its (6, 6) covariance; None for the first."""
        previous, self._T_last = self._T_last, T
        if previous is None:
            return None
        T_a_b = inverse(previous) @ T
        turned, moved = rotation_angle(T_a_b[:3, :3]), float(np.linalg.norm(T_a_b[:3, 3]))
        turn, move = np.hypot(self._floor, np.multiply(self._drift, (turned, moved)))
        return OdometryStep(T_a_b, covariance + pose_covariance((turn, move)))
