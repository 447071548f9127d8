"""Camera motion by KISS-ICP (Vizzo et al. 2023)."""

from __future__ import annotations

import numpy as np
from kiss_icp.config import KISSConfig
from kiss_icp.kiss_icp import KissICP

from ...datasets.frame import BrokenFrame, Frame, FrameProblem
from ...factors.plane_information import point_to_plane_covariance
from ..config import OdometryConfig
from .odometry import KeyframeSteps, OdometryStep, Tracking, TrackingOutcome

DIGITS = 9  # KISS-ICP adds in parallel, so its last bits differ from run to run; a map must not
MIN_POINTS = 200  # fewer depth readings than this cannot be registered


class KissOdometry:
    """KISS-ICP (Vizzo et al. 2023) with a preset for depth cameras.

    KISS-ICP reports no covariance: it is taken from the point-to-plane Hessian of the keyframe's points against the
    local map as it was at the keyframe before, so that a direction along bare planes stays weak.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._icp = KissICP(_kiss_config(config))
        self._keyframes = KeyframeSteps(config)
        self._map_points: np.ndarray | None = None
        self._source = np.empty((0, 3))
        self._rays: np.ndarray | None = None

    def register(self, frame: Frame) -> Tracking:
        points = self._points(frame)
        if len(points) < MIN_POINTS:
            raise BrokenFrame(frame.name, FrameProblem.NO_DEPTH, f"{len(points)} readings in range")
        _, self._source = self._icp.register_frame(points, np.array([]))
        return Tracking(np.round(self._icp.last_pose, DIGITS), TrackingOutcome.GOOD)

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
