"""Shape contexts: how the edge points around a point lie and which way they run (Georgakis et al., section III-A)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .config import ANGLES, LENGTH, ORIENTATIONS, RINGS
from .edge_map import EdgeMap

_RING_LIMITS = (0.25, 0.5)  # of the radius; beyond the last one is the outermost ring
assert len(_RING_LIMITS) == RINGS - 1
_ROUNDING = 1e-9  # of a bin: diagonals lie on limits of the angles, and go to the next bin on every machine


def shape_contexts(
    edges: EdgeMap,
    points: np.ndarray,
    radius: np.ndarray,
    owner: np.ndarray | None = None,
    turn: np.ndarray | None = None,
) -> np.ndarray:
    """Descriptors of some of the points of an edge map: shares of their neighbours by orientation, direction and ring.

    A neighbour is any other point not farther than the radius. It counts in bin
    `(orientation * ANGLES + angle) * RINGS + ring` of

        orientation: o is centred on o pi / ORIENTATIONS of the neighbour's own orientation, which is modulo pi;
        angle: a is centred on 2 pi a / ANGLES of the direction from the point to the neighbour, from x towards y;
        ring: up to r / 4, up to r / 2, up to r, limits included.

    Bins are centred on the axes of the image because upright and level edges are the most frequent: a limit there would
    throw them to either side by chance.

    Args:
        edges: E points.
        points: (S,) integers, which of them are described.
        radius: (S,) float32 pixels, r of every one.
        owner: (E,) integers, what every point belongs to; only points of the same owner are neighbours. None: all are.
        turn: (S,) radians, how far what each point is on is turned in the image, from x towards y; it is described as
            if turned back. None: not at all.

    Returns:
        (S, LENGTH) float32, rows that add up to 1; rows of zeros where nothing is within the radius.

    Raises:
        ValueError: a shape is not as above, a radius is not a positive number, or a point is not one of the edge map's.
    """
    points, radius = np.asarray(points, dtype=np.int64), np.asarray(radius, dtype=np.float64)
    if points.ndim != 1 or radius.shape != points.shape:
        raise ValueError(f"points and radius must be (S,), but got shapes {points.shape} and {radius.shape}")
    if not (np.isfinite(radius) & (radius > 0.0)).all():
        raise ValueError("radius must be positive numbers")
    if ((points < 0) | (points >= len(edges))).any():
        raise ValueError(f"points must be from 0 to {len(edges) - 1}, but are {points.min()} to {points.max()}")
    turn = np.zeros(len(points)) if turn is None else np.asarray(turn, dtype=np.float64)
    if turn.shape != points.shape or not np.isfinite(turn).all():
        raise ValueError(f"turn must be (S,) finite numbers, but got shape {turn.shape}")
    if owner is not None and owner.shape != (len(edges),):
        raise ValueError(f"owner must be ({len(edges)},), but got shape {owner.shape}")
    if len(points) == 0:
        return np.zeros((0, LENGTH), dtype=np.float32)
    orientation = edges.orientation.astype(np.float64) * (ORIENTATIONS / np.pi) + 0.5
    reach = math.floor(float(radius.max()))
    angles = _angles(min(reach, edges.shape[0] - 1), min(reach, edges.shape[1] - 1))
    same = np.zeros(len(edges), dtype=np.int32) if owner is None else owner.astype(np.int32)
    return _count(edges.rows, edges.columns, edges.row_start, orientation, same, points, radius, turn, angles)


def _angles(rows: int, columns: int) -> np.ndarray:
    """(2 rows + 1, 2 columns + 1), the direction of an offset of (y - rows, x - columns) pixels: bin and part of it."""
    y, x = np.arange(-rows, rows + 1), np.arange(-columns, columns + 1)
    turns = np.arctan2(y[:, None], x[None, :]) / (2.0 * np.pi)
    return turns * ANGLES + 0.5 + _ROUNDING


@njit(cache=True, nogil=True)
def _count(
    rows: np.ndarray,
    columns: np.ndarray,
    row_start: np.ndarray,
    orientation: np.ndarray,
    owner: np.ndarray,
    points: np.ndarray,
    radius: np.ndarray,
    turn: np.ndarray,
    angles: np.ndarray,
) -> np.ndarray:
    result = np.zeros((len(points), LENGTH), dtype=np.float32)
    counts = np.empty(LENGTH, dtype=np.int32)
    last_row, middle_y, middle_x = len(row_start) - 2, angles.shape[0] // 2, angles.shape[1] // 2
    for s in range(len(points)):
        point, r2, total = points[s], radius[s] * radius[s], 0
        x, y, mine = int(columns[point]), int(rows[point]), owner[point]
        inner, outer = r2 * _RING_LIMITS[0] ** 2, r2 * _RING_LIMITS[1] ** 2
        reach = int(radius[s])
        back_angle = turn[s] * (ANGLES / (2.0 * math.pi))
        back_orientation = turn[s] * (ORIENTATIONS / math.pi)
        counts[:] = 0
        for row in range(max(y - reach, 0), min(y + reach, last_row) + 1):
            dy = row - y
            half = int(math.sqrt(r2 - dy * dy))
            end = row_start[row + 1]
            for e in range(_first(columns, row_start[row], end, x - half), end):
                dx = columns[e] - x
                if dx > half:
                    break
                if owner[e] != mine or e == point:
                    continue
                d2 = dx * dx + dy * dy
                ring = int(d2 > inner) + int(d2 > outer)
                o = math.floor(orientation[e] - back_orientation) % ORIENTATIONS
                a = math.floor(angles[dy + middle_y, dx + middle_x] - back_angle) % ANGLES
                counts[(o * ANGLES + a) * RINGS + ring] += 1
                total += 1
        if total > 0:
            for k in range(LENGTH):
                result[s, k] = np.float32(counts[k]) / np.float32(total)
    return result


@njit(cache=True, nogil=True)
def _first(columns: np.ndarray, start: int, end: int, least: int) -> int:
    """First of the points from `start` to `end` of a row that is not left of column `least`; `end` if none is."""
    while start < end:
        middle = (start + end) // 2
        if columns[middle] < least:
            start = middle + 1
        else:
            end = middle
    return start
