"""KISS-ICP by itself on depth images, to compare with: every frame, nothing refined, no guess but its own.

The preset is the one that did best on hand-held depth cameras; KISS-ICP's defaults, for LiDAR, fail on them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from kiss_icp.kiss_icp import KissICP

from thingmap.datasets.frame import Frame
from thingmap.mapper.config import OdometryConfig
from thingmap.mapper.trajectory.depth_points import DepthPoints
from thingmap.mapper.trajectory.odometry.kiss_config import kiss_config

PRESET = {"voxel_size": 0.08, "max_iterations": 50, "initial_threshold": 0.1, "min_motion": 0.005}  # m, -, m, m


class KissAlone:
    """Registers frames one after the other.

    Args:
        config: ranges and the spacing of pixels, as the mapper's odometry has them.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._points = DepthPoints(config.pixel_step, config.min_range, config.max_range)
        self._icp = KissICP(kiss_config(replace(config, **PRESET), config.threads))

    def register(self, frame: Frame) -> np.ndarray:
        """(4, 4) `T_first_camera`.

        Raises:
            BrokenFrame: too little depth.
        """
        self._icp.register_frame(self._points(frame), np.array([]))
        return self._icp.last_pose.copy()
