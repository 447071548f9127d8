"""What lies around each proposal: the kernel."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numba import njit


class Beyond(IntEnum):
    """What the neighbour of a point on a proposal's outline is."""

    BORDER = 0  # the image ends there
    NO_READING = 1
    FARTHER = 2  # the proposal stands out before it
    NEARER = 3  # it hides part of the proposal
    SUPPORT = 4  # a plane that things stand on, at the same depth
    PLANE = 5  # another large plane at the same depth
    REST = 6  # another proposal, or what belongs to none, at the same depth


@njit(cache=True)
def outline_counts(labels, depth, owner, is_support, count, jump_share, jump):  # pragma: no cover
    """(N, len(Beyond)) float64 numbers of neighbours around each proposal.

    Args:
        labels: (h, w) int32 of the point grid, -1 for none.
        depth: (h, w) metres, 0 = no reading.
        owner: (h, w) int32 large plane of each point, -1 for none.
        is_support: (P,) bool.
        count: N.
        jump_share: depths that differ by this share and `jump` are not the same.
        jump: metres.
    """
    out = np.zeros((count, 7))
    rows, columns = labels.shape
    for r in range(rows):
        for c in range(columns):
            i = labels[r, c]
            if i < 0:
                continue
            z = depth[r, c]
            for side in range(4):
                y, x = r + (side == 0) - (side == 1), c + (side == 2) - (side == 3)
                if y < 0 or y >= rows or x < 0 or x >= columns:
                    kind = 0
                elif labels[y, x] == i:
                    continue
                elif depth[y, x] <= 0.0:
                    kind = 1
                elif depth[y, x] - z > jump + jump_share * z:
                    kind = 2
                elif z - depth[y, x] > jump + jump_share * z:
                    kind = 3
                elif owner[y, x] >= 0:
                    kind = 4 if is_support[owner[y, x]] else 5
                else:
                    kind = 6
                out[i, kind] += 1.0
    return out
