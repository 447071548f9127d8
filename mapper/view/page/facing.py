"""Which side a point of a cloud shows, so that a page can look into a room through the wall that is in the way."""

from __future__ import annotations

import numpy as np

NEIGHBOURS = 16  # of a point, itself among them, in the plane that is fitted
UNKNOWN = 255  # code of a point without a plane: it is never hidden
STEPS = 15  # of each of the two coordinates of a code; 15 x 15 directions, none farther than 16 degrees from its code


def facing_codes(points: np.ndarray, viewpoints: np.ndarray) -> np.ndarray:
    """(N,) uint8: code of the direction of each point's surface, towards the viewpoint that is nearest to it.

    The normal is the least axis of the nearest points' scatter. Which of its two directions is out is not known from
    points alone; that it is the side from which the nearest camera looked holds except for thin walls seen from both
    sides. A code is 16 a + b, with a and b in 0..14 the octahedral coordinates (x, y) / (|x| + |y| + |z|) of the
    normal, folded over where z < 0; 255 where there is no plane.

    Args:
        points: (N, 3) metres.
        viewpoints: (V, 3) metres, same frame; without any, all codes are 255.
    """
    if len(points) < NEIGHBOURS or len(viewpoints) == 0:
        return np.full(len(points), UNKNOWN, dtype=np.uint8)
    from scipy.spatial import KDTree

    _, near = KDTree(points).query(points, k=NEIGHBOURS)
    normals = _least_axes(points, np.asarray(near))
    _, camera = KDTree(viewpoints).query(points)
    away = np.einsum("ni,ni->n", normals, viewpoints[camera] - points) < 0.0
    normals[away] *= -1.0
    return octahedral_codes(normals)


def _least_axes(points: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(N, 3) unit normals of the planes through the points `near`, (N, K) indices."""
    normals = np.empty_like(points)
    for first in range(0, len(points), 50_000):  # bounds the memory
        part = points[near[first : first + 50_000]]
        part = part - part.mean(axis=1, keepdims=True)
        normals[first : first + 50_000] = np.linalg.eigh(np.einsum("nki,nkj->nij", part, part))[1][:, :, 0]
    return normals


def octahedral_codes(normals: np.ndarray) -> np.ndarray:
    """(N,) uint8 codes of (N, 3) unit vectors, as in `facing_codes`."""
    flat = normals / np.abs(normals).sum(axis=1, keepdims=True)
    xy = flat[:, :2]
    folded = (1.0 - np.abs(xy[:, ::-1])) * np.where(xy >= 0.0, 1.0, -1.0)
    xy = np.where(flat[:, 2:] < 0.0, folded, xy)
    a, b = np.round((xy + 1.0) / 2.0 * (STEPS - 1)).astype(np.uint8).T
    return a * 16 + b
