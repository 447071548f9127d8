"""Rotations as scene formats want them."""

from __future__ import annotations

import numpy as np

Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # z up to y up; x stays


def quaternions(R: np.ndarray) -> np.ndarray:
    """(..., 4) x, y, z, w with w >= 0 of (..., 3, 3) rotations."""
    from scipy.spatial.transform import Rotation

    matrices = np.asarray(R, dtype=np.float64)
    flat = matrices.reshape(-1, 3, 3)
    found = Rotation.from_matrix(flat).as_quat(canonical=True) if len(flat) else np.empty((0, 4))
    return found.reshape(*matrices.shape[:-2], 4)
