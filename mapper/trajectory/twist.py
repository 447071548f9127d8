"""Exp and Log of SE(3) for many poses at once: what lies a share of the way along a correction."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

SMALL = 1e-4  # rad, below which two terms of the series are exact to 1e-10


def exp(twists: np.ndarray) -> np.ndarray:
    """(N, 6) twists [w rad, v m], GTSAM's order, to (N, 4, 4) motions.

    Exp([w, v]) = (Exp(w), V v),  V = I + (1 - cos a) / a^2 [w]_x + (a - sin a) / a^3 [w]_x^2,  a = |w|
    """
    w = twists[:, :3]
    angle = np.linalg.norm(w, axis=1)
    small = angle < SMALL
    a = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(a)) / a**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (a - np.sin(a)) / a**3)
    T = np.tile(np.eye(4), (len(twists), 1, 1))
    T[:, :3, :3] = Rotation.from_rotvec(w).as_matrix()
    T[:, :3, 3] = _series(w, first, second, twists[:, 3:])
    return T


def log(T: np.ndarray) -> np.ndarray:
    """(N, 4, 4) rigid motions to the (N, 6) shortest twists [w rad, v m] with Exp(twist) = T; turns up to pi.

    v = V^-1 t,  V^-1 = I - [w]_x / 2 + (1 - (a / 2) cot(a / 2)) / a^2 [w]_x^2
    """
    w = Rotation.from_matrix(T[:, :3, :3]).as_rotvec()
    angle = np.linalg.norm(w, axis=1)
    small = angle < SMALL
    half = np.where(small, 1.0, angle / 2.0)
    second = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, (1.0 - half / np.tan(half)) / (2.0 * half) ** 2)
    return np.hstack([w, _series(w, np.full(len(w), -0.5), second, T[:, :3, 3])])


def inverses(T: np.ndarray) -> np.ndarray:
    """Inverses of (N, 4, 4) rigid transforms."""
    result = np.zeros_like(T)
    result[:, :3, :3] = np.swapaxes(T[:, :3, :3], 1, 2)
    result[:, :3, 3] = -np.einsum("nji,nj->ni", T[:, :3, :3], T[:, :3, 3])
    result[:, 3, 3] = 1.0
    return result


def _series(w: np.ndarray, first: np.ndarray, second: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(N, 3): (I + first [w]_x + second [w]_x^2) v."""
    across = np.cross(w, v)
    return v + first[:, None] * across + second[:, None] * np.cross(w, across)
