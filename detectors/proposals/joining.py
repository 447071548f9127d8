"""Pieces of one surface joined again: mean shift cuts what is larger than its kernel anywhere.

Two things that touch meet in a concave crease, the parts of one thing in a smooth or a convex place; so neighbours are
joined where the surface does not fold towards the camera between them. (The test of S. C. Stein et al., Object
Partitioning using Local Convexity, CVPR 2014, here on the points at the border of the pieces.)
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .point_grid import SPAN, PointGrid
from .segments import piece_bounds


@njit(cache=True)
def contacts(pieces, points, normals, count, jump_share, jump):  # pragma: no cover
    """Where pieces meet without a jump of depth.

    Returns:
        (N, N) float32 number of neighbouring points, and sum of the angles of the surface there, radians: positive for
        an edge seen from outside, negative for a crease. Both symmetric.
    """
    rows, columns = pieces.shape
    met = np.zeros((count, count), dtype=np.float32)
    fold = np.zeros((count, count), dtype=np.float32)
    for r in range(rows):
        for c in range(columns):
            i = pieces[r, c]
            if i < 0:
                continue
            for axis in range(2):
                y, x = r + axis, c + 1 - axis
                if y >= rows or x >= columns:
                    continue
                j = pieces[y, x]
                if j < 0 or j == i:
                    continue
                z = points[r, c, 2]
                if abs(points[y, x, 2] - z) > jump + jump_share * z:
                    continue
                y0, x0 = r - (SPAN - 1) * axis, c - (SPAN - 1) * (1 - axis)
                y1, x1 = y + (SPAN - 1) * axis, x + (SPAN - 1) * (1 - axis)
                if y0 < 0 or x0 < 0 or y1 >= rows or x1 >= columns or pieces[y0, x0] != i or pieces[y1, x1] != j:
                    continue
                cosine = sign = 0.0
                for k in range(3):
                    cosine += normals[y0, x0, k] * normals[y1, x1, k]
                    sign += (normals[y0, x0, k] - normals[y1, x1, k]) * (points[y0, x0, k] - points[y1, x1, k])
                if cosine == 0.0:
                    continue
                angle = np.arccos(min(1.0, max(-1.0, cosine)))
                angle = angle if sign > 0.0 else -angle
                met[i, j] += 1.0
                met[j, i] += 1.0
                fold[i, j] += angle
                fold[j, i] += angle
    return met, fold


def joined(
    pieces: np.ndarray,
    grid: PointGrid,
    *,
    least_fold: float,
    least_contact: float,
    max_extent: float,
    jump_share: float,
    jump: float,
) -> np.ndarray:
    """(h, w) int32 pieces, neighbours that are of one surface joined; numbered anew, -1 for none.

    Args:
        pieces: (h, w) int32, -1 for none.
        grid: the points.
        least_fold: radians; a mean fold below it (deeper creases) keeps pieces apart.
        least_contact: neighbouring points, over the square root of the smaller piece's points, for pieces to be joined.
        max_extent: metres, of the box in camera axes of what is joined.
        jump_share: as of `connected_pieces`.
        jump: likewise.
    """
    count = int(pieces.max(initial=-1)) + 1
    if count < 2:
        return pieces
    points = grid.points
    met, fold = contacts(pieces, points, grid.normals, count, jump_share, jump)
    _, box = piece_bounds(pieces, points, count)
    low, high = box[:, 0], box[:, 1]
    size = np.bincount(pieces[pieces >= 0], minlength=count)
    first, second = np.nonzero(np.triu(met))
    share = met[first, second] / np.sqrt(np.minimum(size[first], size[second]))
    angle = fold[first, second] / met[first, second]
    good = (share >= least_contact) & (angle >= least_fold)
    group = np.arange(count)
    for k in np.flatnonzero(good)[np.argsort(-share[good], kind="stable")]:
        a, b = sorted((group[first[k]], group[second[k]]))
        low_ab, high_ab = np.minimum(low[a], low[b]), np.maximum(high[a], high[b])
        if a != b and (high_ab - low_ab).max() <= max_extent:
            group[group == b] = a
            low[a], high[a] = low_ab, high_ab
    _, number = np.unique(group, return_inverse=True)
    return np.append(number, -1).astype(np.int32)[pieces]
