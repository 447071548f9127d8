"""KISS-ICP's own configuration from the numbers of ours."""

from __future__ import annotations

from kiss_icp.config import KISSConfig

from ...config import LidarConfig, OdometryConfig


def kiss_config(config: OdometryConfig | LidarConfig, threads: int) -> KISSConfig:
    """For depth images or sweeps; motion within a sweep is taken out before KISS-ICP sees it."""
    kiss = KISSConfig()
    kiss.data.deskew = False
    kiss.data.min_range, kiss.data.max_range = config.min_range, config.max_range
    kiss.mapping.voxel_size = config.voxel_size
    kiss.registration.max_num_iterations = config.max_iterations
    kiss.registration.max_num_threads = threads
    kiss.adaptive_threshold.initial_threshold = config.initial_threshold
    kiss.adaptive_threshold.min_motion_th = config.min_motion
    return kiss
