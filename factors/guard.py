"""Weak permanent priors on every object: whatever factors come and go, the system stays solvable.

An object whose last box factor is switched off or removed would leave its variables free, and an indeterminate system
destroys iSAM2. These two priors are added with the object and never removed; they are too weak to be felt otherwise.
"""

from __future__ import annotations

import gtsam
import numpy as np

POSITION_SIGMA_M = 10.0
SIZE_SIGMA_LOG = 1.5  # a factor of 4.5 either way


def position_guard(l_key: int, center_world: np.ndarray, sigma_m: float = POSITION_SIGMA_M) -> gtsam.PriorFactorPoint3:
    """Keeps a Point3 near where the object was first seen, (3,) metres, world frame."""
    noise = gtsam.noiseModel.Isotropic.Sigma(3, sigma_m)
    return gtsam.PriorFactorPoint3(l_key, np.asarray(center_world, dtype=float), noise)


def size_guard(s_key: int, mean_log: np.ndarray, sigma_log: float = SIZE_SIGMA_LOG) -> gtsam.PriorFactorVector:
    """Keeps a Vector3 of log half-axes near a stated mean, (3,) log of metres (class 0 of the size priors)."""
    noise = gtsam.noiseModel.Isotropic.Sigma(3, sigma_log)
    return gtsam.PriorFactorVector(s_key, np.asarray(mean_log, dtype=float), noise)
