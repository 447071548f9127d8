"""Camera motion from frame to frame, as measurements for the graph."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from kiss_icp.config import KISSConfig
from kiss_icp.kiss_icp import KissICP

from ...datasets.frame import BrokenFrame, Frame, FrameProblem
from ...factors.plane_information import point_to_plane_covariance
from ..config import OdometryConfig, OdometrySource

DIGITS = 9  # KISS-ICP adds in parallel, so its last bits differ from run to run; a map must not
MIN_POINTS = 200  # fewer depth readings than this cannot be registered


@dataclass(frozen=True, slots=True, eq=False)
class OdometryStep:
    """Motion between two keyframes.

    Attributes:
        T_a_b: (4, 4) camera b in camera a.
        covariance: (6, 6) in the right tangent of `T_a_b`, [rotation rad, translation m], GTSAM's order.
    """

    T_a_b: np.ndarray
    covariance: np.ndarray


class Odometry(Protocol):
    """Registers every frame; measures the motion between the frames that become keyframes."""

    def register(self, frame: Frame) -> np.ndarray:
        """(4, 4) `T_odometry_camera` of this frame, in the odometry's own world."""
        ...

    def keyframe(self) -> OdometryStep | None:
        """Makes the last registered frame a keyframe: the motion since the one before, or None for the first."""
        ...


def inverse(T: np.ndarray) -> np.ndarray:
    """Inverse of a (4, 4) rigid transform."""
    R, t = T[:3, :3], T[:3, 3]
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = R.T, -R.T @ t
    return result


def rotation_angle(R: np.ndarray) -> float:
    """Angle of a (3, 3) rotation, rad."""
    return float(np.arccos(np.clip((np.trace(R) - 1.0) / 2.0, -1.0, 1.0)))


class _Keyframes:
    """Relative motion and a covariance that grows with it."""

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._T_last: np.ndarray | None = None

    def step(self, T: np.ndarray, covariance: np.ndarray) -> OdometryStep | None:
        previous, self._T_last = self._T_last, T
        if previous is None:
            return None
        T_a_b = inverse(previous) @ T
        turned, moved = rotation_angle(T_a_b[:3, :3]), float(np.linalg.norm(T_a_b[:3, 3]))
        (floor_r, floor_t), (drift_r, drift_t) = self._config.covariance_floor, self._config.drift
        sigmas = np.repeat([np.hypot(floor_r, drift_r * turned), np.hypot(floor_t, drift_t * moved)], 3)
        return OdometryStep(T_a_b, covariance + np.diag(sigmas**2))


class KissOdometry:
    """KISS-ICP (Vizzo et al. 2023) with a preset for depth cameras.

    KISS-ICP reports no covariance: it is taken from the point-to-plane Hessian of the keyframe's points against the
    local map as it was at the keyframe before, so that a direction along bare planes stays weak.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._icp = KissICP(_kiss_config(config))
        self._keyframes = _Keyframes(config)
        self._map_points: np.ndarray | None = None
        self._source = np.empty((0, 3))
        self._rays: np.ndarray | None = None

    def register(self, frame: Frame) -> np.ndarray:
        points = self._points(frame)
        if len(points) < MIN_POINTS:
            raise BrokenFrame(frame.name, FrameProblem.NO_DEPTH, f"{len(points)} readings in range")
        _, self._source = self._icp.register_frame(points, np.array([]))
        return np.round(self._icp.last_pose, DIGITS)

    def keyframe(self) -> OdometryStep | None:
        T = np.round(self._icp.last_pose, DIGITS)
        covariance = np.zeros((6, 6))
        if self._map_points is not None:
            # two scans were matched to the same map
            covariance = 2.0 * point_to_plane_covariance(self._source, T, self._map_points).covariance()
        self._map_points = np.round(self._icp.local_map.point_cloud(), DIGITS)
        return self._keyframes.step(T, covariance)

    def _points(self, frame: Frame) -> np.ndarray:
        """(N, 3) float64 camera-frame points of every `pixel_step`-th pixel within range."""
        c, k = self._config, frame.intrinsics
        offset = c.pixel_step // 2
        z = frame.depth[offset :: c.pixel_step, offset :: c.pixel_step]
        if self._rays is None or self._rays.shape[:2] != z.shape:
            v, u = np.mgrid[offset : k.height : c.pixel_step, offset : k.width : c.pixel_step]
            self._rays = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones(u.shape)], axis=-1)
        valid = (z > c.min_range) & (z < c.max_range)
        return self._rays[valid] * z[valid].astype(np.float64)[:, None]


class PoseOdometry:
    """The dataset's own poses taken as measurements; the world is the dataset's."""

    def __init__(self, config: OdometryConfig) -> None:
        sigma_r, sigma_t = config.pose_sigma
        self._covariance = 2.0 * np.diag(np.repeat([sigma_r**2, sigma_t**2], 3))  # both ends are measured
        self._keyframes = _Keyframes(config)
        self._T = np.eye(4)

    def register(self, frame: Frame) -> np.ndarray:
        if frame.T_world_camera is None:
            raise BrokenFrame(frame.name, FrameProblem.MISSING_POSE)
        self._T = frame.T_world_camera
        return self._T

    def keyframe(self) -> OdometryStep | None:
        return self._keyframes.step(self._T, self._covariance)


def make_odometry(config: OdometryConfig) -> Odometry:
    """The odometry that the configuration names."""
    return PoseOdometry(config) if config.source is OdometrySource.POSES else KissOdometry(config)


def _kiss_config(config: OdometryConfig) -> KISSConfig:
    kiss = KISSConfig()
    kiss.data.deskew = False
    kiss.data.min_range, kiss.data.max_range = config.min_range, config.max_range
    kiss.mapping.voxel_size = config.voxel_size
    kiss.registration.max_num_iterations = config.max_iterations
    kiss.registration.max_num_threads = config.threads
    kiss.adaptive_threshold.initial_threshold = config.initial_threshold
    kiss.adaptive_threshold.min_motion_th = config.min_motion
    return kiss
