"""Depth without holes (the recursive median filter of Lai et al., section III-C)."""

from __future__ import annotations

import numpy as np
from numba import njit


def filled(depth: np.ndarray) -> np.ndarray:
    """Depth whose missing pixels are medians of their neighbours', from the rims of holes inwards.

    Every round gives the missing pixels beside known ones the median of the known ones among their eight neighbours,
    until none is missing; known ones stay as they are. Of two middle values the farther is taken: what a depth camera
    does not see beside an edge is the background, which the nearer thing hides from its projector.

    Args:
        depth: (H, W) metres; no reading where it is not a positive, finite number.

    Returns:
        (H, W) float32 metres; all 0 where nothing is known.
    """
    out = np.ascontiguousarray(depth, dtype=np.float32).copy()
    _fill(out)
    return out


@njit(cache=True, nogil=True)
def _fill(depth):
    rows, columns = depth.shape
    # of every pixel: 0 unknown, 1 in the list of this or the next round, 2 known; with a frame, so that all have eight
    state = np.full((rows + 2, columns + 2), 1, np.uint8)
    missing = 0
    for y in range(rows):
        for x in range(columns):
            is_known = depth[y, x] > 0.0 and depth[y, x] < np.inf
            state[y + 1, x + 1] = 2 if is_known else 0
            if not is_known:
                depth[y, x] = 0.0
                missing += 1
    ys, xs, values = np.empty(missing, np.int32), np.empty(missing, np.int32), np.empty(missing, np.float32)
    near = np.empty(8, np.float32)
    end = 0
    for y in range(rows):
        for x in range(columns):
            if state[y + 1, x + 1] == 0 and _has_known(state, y, x):
                ys[end], xs[end] = y, x
                end += 1
    for i in range(end):
        state[ys[i] + 1, xs[i] + 1] = 1
    start = 0
    while start < end:
        for i in range(start, end):
            values[i] = _median_around(depth, state, ys[i], xs[i], near)
        for i in range(start, end):
            depth[ys[i], xs[i]] = values[i]
            state[ys[i] + 1, xs[i] + 1] = 2
        last = end
        for i in range(start, last):
            for v in range(ys[i] - 1, ys[i] + 2):
                for u in range(xs[i] - 1, xs[i] + 2):
                    if state[v + 1, u + 1] == 0:
                        state[v + 1, u + 1] = 1
                        ys[end], xs[end] = v, u
                        end += 1
        start = last


@njit(cache=True, nogil=True)
def _has_known(state, y, x):
    for v in range(y, y + 3):
        for u in range(x, x + 3):
            if state[v, u] == 2:
                return True
    return False


@njit(cache=True, nogil=True)
def _median_around(depth, state, y, x, near):
    """Of the known ones among the eight around (y, x), sorted into `near`; the farther of two middle ones."""
    count = 0
    for v in range(y - 1, y + 2):
        for u in range(x - 1, x + 2):
            if state[v + 1, u + 1] == 2:
                value, at = depth[v, u], count
                while at > 0 and near[at - 1] > value:
                    near[at] = near[at - 1]
                    at -= 1
                near[at] = value
                count += 1
    return near[count // 2]
