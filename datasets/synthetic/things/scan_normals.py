"""Smooth normals for meshes that come without."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..mesh import CREASE


def corner_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals of all corners of all triangles, from the mean over the triangles that meet there.

    Vertices at the same place count as one, because textured meshes double them along seams. Triangles that bend by
    more than the crease angle of `mesh` keep their edge.

    Args:
        vertices: (V, 3) metres.
        triangles: (T, 3) vertex numbers.

    Returns:
        (3 T, 3) float64, corner by corner; up where a triangle has no area.
    """
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    length = np.linalg.norm(area, axis=1, keepdims=True)
    facing = np.where(length > 0.0, area / np.maximum(length, 1e-300), (0.0, 0.0, 1.0))
    _, place = np.unique(vertices, axis=0, return_inverse=True)
    at = place.ravel()[triangles].ravel()
    order = np.argsort(at, kind="stable")
    start = np.flatnonzero(np.r_[True, np.diff(at[order]) > 0, True])
    return _averaged(order, start, area, facing)


@njit(cache=True)
def _averaged(order, start, area, facing):
    """Sum of the areas around each corner that are bent little against its own triangle, normalised."""
    out = np.zeros((order.size, 3))
    for group in range(start.size - 1):
        for i in range(start[group], start[group + 1]):
            own = order[i] // 3
            x = y = z = 0.0
            for j in range(start[group], start[group + 1]):
                other = order[j] // 3
                along = facing[own, 0] * facing[other, 0] + facing[own, 1] * facing[other, 1]
                if along + facing[own, 2] * facing[other, 2] > CREASE:
                    x, y, z = x + area[other, 0], y + area[other, 1], z + area[other, 2]
            length = np.sqrt(x * x + y * y + z * z)
            if length > 0.0:
                out[order[i], 0], out[order[i], 1], out[order[i], 2] = x / length, y / length, z / length
            else:
                out[order[i]] = facing[own]
    return out
