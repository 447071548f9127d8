"""KISS-ICP by itself on depth images, to compare with: every frame, nothing refined, no guess but its own.

The preset is the one that did best on hand-held depth cameras; KISS-ICP's defaults, for LiDAR, fail on them.
"""

from __future__ import annotations

import numpy as np
from kiss_icp.config import KISSConfig
from kiss_icp.kiss_icp import KissICP

from thingmap.datasets.frame import Frame
from thingmap.mapper.config import OdometryConfig
from thingmap.mapper.trajectory.depth_points import DepthPoints

VOXEL_SIZE = 0.08  # m
INITIAL_THRESHOLD = 0.1  # m
MIN_MOTION = 0.005  # m
MAX_ITERATIONS = 50


class KissAlone:
    """Registers frames one after the other.

    Args:
        config: ranges and the spacing of pixels, as the mapper's odometry has them.
    """

    def __init__(self, config: OdometryConfig) -> None:
        kiss = KISSConfig()
        kiss.data.deskew = False
        kiss.data.min_range, kiss.data.max_range = config.min_range, config.max_range
        kiss.mapping.voxel_size = VOXEL_SIZE
        kiss.registration.max_num_iterations = MAX_ITERATIONS
        kiss.registration.max_num_threads = config.threads
        kiss.adaptive_threshold.initial_threshold = INITIAL_THRESHOLD
        kiss.adaptive_threshold.min_motion_th = MIN_MOTION
        self._points = DepthPoints(config.pixel_step, config.min_range, config.max_range)
        self._icp = KissICP(kiss)

    def register(self, frame: Frame) -> np.ndarray:
        """(4, 4) `T_first_camera`.

        Raises:
            BrokenFrame: too little depth.
        """
        self._icp.register_frame(self._points(frame), np.array([]))
        return self._icp.last_pose.copy()
