"""Random views of volumes, and numerical derivatives of their image boxes."""

from __future__ import annotations

from collections.abc import Callable

import gtsam
import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from thingmap.factors.volume import Projection

STEADY = settings(deadline=None, derandomize=True, max_examples=150)
seeds = st.integers(0, 2**32 - 1)


def random_view(seed: int) -> tuple[gtsam.Pose3, np.ndarray, np.ndarray, np.ndarray]:
    """A pose, an upright frame, and a centre and log half-axes of a volume ahead of the camera."""
    rng = np.random.default_rng(seed)
    pose = gtsam.Pose3(gtsam.Rot3.Expmap(rng.normal(size=3)), 3.0 * rng.normal(size=3))
    R_world_upright = gtsam.Rot3.Expmap(rng.normal(size=3)).matrix()
    ahead = np.array([1.0, 1.0, 0.0]) * rng.normal(size=3) + [0.0, 0.0, rng.uniform(0.5, 6.0)]
    return pose, R_world_upright, pose.transformFrom(ahead), np.log(rng.uniform(0.01, 0.6, 3))


def numerical_jacobian(
    project: Callable[..., Projection], pose, R_world_upright, center, log_half_axes, h: float = 1e-6
) -> np.ndarray:
    """(4, 12) central differences by the pose's right tangent, the centre and the log half-axes."""

    def box(d: np.ndarray) -> np.ndarray:
        T = pose.retract(d[:6]).matrix()
        return project(T, R_world_upright, center + d[6:9], log_half_axes + d[9:]).xyxy

    return np.stack([(box(d) - box(-d)) / (2 * h) for d in h * np.eye(12)], axis=1)
