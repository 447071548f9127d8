"""The ellipsoid and the solid as sums, point by point, of ellipsoids: which of their points the camera should see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import gtsam
import numpy as np

from thingmap.factors.solid import ROUNDNESS, project_solid, project_solids
from thingmap.factors.volume import Projection, project_volume, project_volumes


@dataclass(frozen=True)
class Body:
    """What is projected, and what it is made of.

    Attributes:
        project, project_all: the functions that are tested.
        summands: (M, 3) half-axes of the ellipsoids that it is the sum of, for extents of 1.
    """

    project: Callable[..., Projection]
    project_all: Callable[..., tuple[np.ndarray, np.ndarray]]
    summands: np.ndarray

    def farthest(self, directions: np.ndarray, log_half_axes: np.ndarray) -> np.ndarray:
        """(N, 3) points, about its centre and along its axes, that are farthest along (N, 3) directions."""
        points = np.zeros_like(directions)
        for half_axes in self.summands * np.exp(log_half_axes):
            points += directions * half_axes**2 / np.linalg.norm(directions * half_axes, axis=1, keepdims=True)
        return points

    def surface(self, log_half_axes: np.ndarray) -> np.ndarray:
        """(N, 3) points all over it, about its centre and along its axes, closest where it bends most."""
        polar, around = np.meshgrid(np.linspace(1e-3, np.pi - 1e-3, 101), np.linspace(0, 2 * np.pi, 101))
        ball = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
        return self.farthest(ball.reshape(-1, 3) / np.exp(log_half_axes), log_half_axes)

    def nearest_depth(
        self, pose: gtsam.Pose3, R_world_upright: np.ndarray, center: np.ndarray, log_half_axes: np.ndarray
    ) -> float:
        """Metres before the camera of its nearest point."""
        towards = -(pose.rotation().matrix().T @ R_world_upright)[2:]
        return float(pose.transformTo(center)[2] - (self.farthest(towards, log_half_axes) @ towards.T)[0, 0])


ELLIPSOID = Body(project_volume, project_volumes, np.ones((1, 3)))
SOLID = Body(
    project_solid, project_solids, np.array([[1.0, 1.0, ROUNDNESS], [ROUNDNESS, ROUNDNESS, 1.0]]) / (1.0 + ROUNDNESS)
)


def box_of_points(pose: gtsam.Pose3, R_world_upright: np.ndarray, center: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(4,) image box of (N, 3) points about a centre, along the upright axes."""
    camera = (center + points @ R_world_upright.T - pose.translation()) @ pose.rotation().matrix()
    rays = camera[:, :2] / camera[:, 2:]
    return np.concatenate([rays.min(axis=0), rays.max(axis=0)])
