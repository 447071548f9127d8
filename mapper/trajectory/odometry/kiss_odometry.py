"""Camera motion by KISS-ICP (Vizzo et al. 2023), each pose refined against a local model."""

from __future__ import annotations

import numpy as np
import small_gicp
from kiss_icp.kiss_icp import KissICP

from ...config import OdometryConfig
from ..rigid import inverse, nearest_rigid
from .gicp_odometry import GicpOdometry
from .kiss_config import kiss_config

DIGITS = 9  # KISS-ICP adds in parallel, so its last bits differ from run to run; a map must not


class KissOdometry(GicpOdometry):
    """KISS-ICP with a preset for depth cameras registers each frame, `GicpOdometry`'s model refines the pose.

    KISS-ICP finds the way from afar and tells how far that was (its adaptive threshold); but points matched to points
    drag along a table-top: 8.6 mm a frame on a rendered hand-held sequence, 2.8 mm once refined. So it may stop early,
    its own map takes refined poses only, and only frames that show something new.
    """

    def __init__(self, config: OdometryConfig) -> None:
        super().__init__(config)
        self._icp = KissICP(kiss_config(config, config.threads))
        self._dense = np.empty((0, 3))
        self._T_guess = np.eye(4)

    def _approach(self, points: np.ndarray, T_guess: np.ndarray) -> np.ndarray:
        icp = self._icp
        source, self._dense = icp.voxelize(points)
        threshold = icp.adaptive_threshold.get_threshold()
        self._T_guess = T_guess
        T = icp.registration.align_points_to_map(
            points=source,
            voxel_map=icp.local_map,
            initial_guess=nearest_rigid(T_guess),
            max_correspondance_distance=3.0 * threshold,
            kernel=threshold,
        )
        return nearest_rigid(np.round(T, DIGITS))

    def _take_in(self, cloud: small_gicp.PointCloud, points: np.ndarray) -> None:
        icp = self._icp
        if self._model.empty:
            self._dense = icp.voxelize(points)[1]
        else:
            icp.adaptive_threshold.update_model_deviation(inverse(self._T_guess) @ self._T)
        if self._model.take_in(cloud, self._T):
            icp.local_map.update(self._dense, self._T)

    def _start_anew(self, cloud: small_gicp.PointCloud, points: np.ndarray) -> None:
        self._icp.local_map.clear()
        super()._start_anew(cloud, points)
