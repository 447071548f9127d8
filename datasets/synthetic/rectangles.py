"""How far rectangles in the plane are apart."""

from __future__ import annotations

import numpy as np


def separations(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """How far rectangles are apart along the best separating axis; negative where they overlap.

    Args:
        a: (N, 5) x, y, yaw (radians) and half extents along their own axes, metres.
        b: (M, 5).

    Returns:
        (N, M) metres, never more than their distance.
    """
    apart = np.full((len(a), len(b)), -np.inf)
    between = b[None, :, :2] - a[:, None, :2]
    turn = b[None, :, 2] - a[:, None, 2]
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    half_a, half_b = a[:, None, 3:], b[None, :, 3:]
    for yaw, own, other in ((a[:, None, 2], half_a, half_b), (b[None, :, 2], half_b, half_a)):
        along = np.abs(np.cos(yaw) * between[..., 0] + np.sin(yaw) * between[..., 1])
        across = np.abs(np.cos(yaw) * between[..., 1] - np.sin(yaw) * between[..., 0])
        apart = np.maximum(apart, along - own[..., 0] - c * other[..., 0] - s * other[..., 1])
        apart = np.maximum(apart, across - own[..., 1] - s * other[..., 0] - c * other[..., 1])
    return apart
