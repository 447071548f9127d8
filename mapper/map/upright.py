"""The upright frame: the axes along which the boxes of a map are measured."""

from __future__ import annotations

import numpy as np

NEAR_PARALLEL = 0.99  # |cosine| above which the map's x axis is too close to up to give a horizontal direction


def upright_rotation(up: np.ndarray) -> np.ndarray:
    """Axes of the upright frame in the map frame.

    z is `up`; x is the horizontal projection of the map's x axis (of its y axis where x is within 8 degrees of
    vertical), so that a map whose up is +z gets the identity.

    Args:
        up: (3,) direction in the map frame, any positive length.

    Returns:
        (3, 3) `R_world_upright`; its columns are the upright axes in map coordinates.

    Raises:
        ValueError: where `up` has no direction.
    """
    up = np.asarray(up, dtype=np.float64)
    length = np.linalg.norm(up)
    if up.shape != (3,) or not np.isfinite(length) or length == 0.0:
        raise ValueError(f"up must be a (3,) vector with a direction, but got {up!r}")
    z = up / length
    reference = np.array([1.0, 0.0, 0.0]) if abs(z[0]) <= NEAR_PARALLEL else np.array([0.0, 1.0, 0.0])
    x = reference - (reference @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
