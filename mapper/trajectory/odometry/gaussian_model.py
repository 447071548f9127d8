"""A model of what was seen lately, one Gaussian a voxel, and frames registered to it (VGICP, Koide et al. 2021).

Each voxel holds the mean and covariance of all points seen in it, so that noise averages out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import small_gicp

from ...config import GicpConfig
from ..rigid import inverse, nearest_rigid, rotation_angle

THREADS = 1  # small_gicp adds in parallel: with more, the last bits differ from run to run, and a map must not
EPSILON = 3e-4  # rad, m: steps smaller than this have converged
CLEAR_CYCLE = 10  # insertions between removals of voxels beyond the model's horizon


@dataclass(frozen=True, slots=True, eq=False)
class ModelFit:
    """How a frame lies in the model.

    Attributes:
        T: (4, 4) its pose in the model's frame.
        share: of its points that have a partner.
        translation_ratio: smallest / largest eigenvalue of the Hessian's translation block. At least as large as that
            of the point-to-plane Hessian divided by four: 0.001 at walls, from 0.02 in rooms.
    """

    T: np.ndarray
    share: float
    translation_ratio: float


class GaussianModel:
    """Grows whenever the camera has moved a little; forgets what has not been seen for a while."""

    def __init__(self, config: GicpConfig) -> None:
        self._config = config
        self.clear()

    @property
    def empty(self) -> bool:
        """Whether nothing was put in yet."""
        return self._model.size() == 0

    def clear(self) -> None:
        """Forgets everything."""
        self._model = small_gicp.GaussianVoxelMap(self._config.voxel_size)
        self._model.set_lru(horizon=self._config.horizon, clear_cycle=CLEAR_CYCLE)
        self._T_last: np.ndarray | None = None

    def prepare(self, points: np.ndarray) -> small_gicp.PointCloud:
        """(N, 3) points of a frame, thinned out, each with the plane around it."""
        c = self._config
        cloud, _ = small_gicp.preprocess_points(
            points, downsampling_resolution=c.spacing, num_neighbors=c.neighbours, num_threads=THREADS
        )
        return cloud

    def align(self, cloud: small_gicp.PointCloud, T_guess: np.ndarray) -> ModelFit:
        """Registers a prepared frame, from (4, 4) `T_guess`."""
        result = small_gicp.align(
            self._model,
            cloud,
            T_guess,
            max_correspondence_distance=self._config.correspondence,
            num_threads=THREADS,
            max_iterations=self._config.max_iterations,
            rotation_epsilon=EPSILON,
            translation_epsilon=EPSILON,
        )
        strength = np.linalg.eigvalsh(np.array(result.H)[3:, 3:])
        ratio = float(strength[0] / strength[-1]) if strength[-1] > 0.0 else 0.0
        share = result.num_inliers / max(cloud.size(), 1)
        return ModelFit(nearest_rigid(np.array(result.T_target_source)), share, ratio)

    def take_in(self, cloud: small_gicp.PointCloud, T: np.ndarray) -> bool:
        """Adds a registered frame, unless the last one added was seen from about the same place; whether it did."""
        if self._T_last is not None:
            c, motion = self._config, inverse(self._T_last) @ T
            if np.linalg.norm(motion[:3, 3]) < c.step[1] and rotation_angle(motion[:3, :3]) < c.step[0]:
                return False
        self._model.insert(cloud, T)
        self._T_last = T
        return True
