"""Clusters of points in the image: connected pieces of one cluster without a jump of depth inside."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def connected_pieces(clusters, depth, jump_share, jump):  # pragma: no cover
    """Connected components of a label image.

    Args:
        clusters: (h, w) int32, -1 for none.
        depth: (h, w) metres.
        jump_share: neighbours whose depths differ by more than `jump` + this share are not connected.
        jump: metres.

    Returns:
        (h, w) int32 numbered from 0 in the order of their first points, -1 for none.
    """
    rows, columns = clusters.shape
    out = np.full((rows, columns), -1, dtype=np.int32)
    queue = np.empty(rows * columns, dtype=np.int64)
    count = 0
    for start in range(rows * columns):
        r, c = start // columns, start % columns
        if clusters[r, c] < 0 or out[r, c] >= 0:
            continue
        out[r, c] = count
        queue[0], head, tail = start, 0, 1
        while head < tail:
            r, c = queue[head] // columns, queue[head] % columns
            head += 1
            z = depth[r, c]
            for side in range(4):
                y, x = r + (side == 0) - (side == 1), c + (side == 2) - (side == 3)
                if y < 0 or y >= rows or x < 0 or x >= columns:
                    continue
                if out[y, x] >= 0 or clusters[y, x] != clusters[r, c]:
                    continue
                if abs(depth[y, x] - z) > jump + jump_share * z:
                    continue
                out[y, x] = count
                queue[tail] = y * columns + x
                tail += 1
        count += 1
    return out


def renumbered(pieces: np.ndarray, keep: np.ndarray) -> np.ndarray:
    """Label image with only the pieces that `keep` (N,) bool names, numbered from 0 in order; -1 elsewhere."""
    number = np.full(len(keep) + 1, -1, dtype=np.int32)  # the last is that of label -1
    number[:-1][keep] = np.arange(int(keep.sum()), dtype=np.int32)
    return number[pieces]


@njit(cache=True)
def piece_bounds(pieces, points, count):  # pragma: no cover
    """(N, 4) int64 first column and row, last column and row of each piece, and (N, 2, 3) its box in camera axes."""
    sides = np.empty((count, 4), dtype=np.int64)
    sides[:, :2] = np.iinfo(np.int64).max
    sides[:, 2:] = -1
    box = np.empty((count, 2, 3), dtype=np.float64)
    box[:, 0] = np.inf
    box[:, 1] = -np.inf
    for r in range(pieces.shape[0]):
        for c in range(pieces.shape[1]):
            i = pieces[r, c]
            if i < 0:
                continue
            sides[i, 0], sides[i, 1] = min(sides[i, 0], c), min(sides[i, 1], r)
            sides[i, 2], sides[i, 3] = max(sides[i, 2], c), max(sides[i, 3], r)
            for k in range(3):
                box[i, 0, k] = min(box[i, 0, k], points[r, c, k])
                box[i, 1, k] = max(box[i, 1, k], points[r, c, k])
    return sides, box
