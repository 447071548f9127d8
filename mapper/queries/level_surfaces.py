"""Level surfaces of the cloud: tops of tables and the floor, which no detector has to name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CELL = 2.0  # of the points' spacing: so wide that a surface has a point in every cell of it
CLEAR = 2  # cells: a wall has points so far above or below each of its own, a level surface at most where things stand
LEAST_AREA = 0.25  # m^2: half a metre square, a small side table
SPREAD = 0.02  # m, of heights in a surface: more is a slope, or a heap of things
MEDIAN_TO_STD = 1.4826  # a normal variable's standard deviation by the median of its absolute deviations


@dataclass(frozen=True, slots=True, eq=False)
class LevelSurface:
    """A level surface in the upright frame.

    Attributes:
        centre: (2,) of the smallest rectangle about it, metres.
        extents: (2,) of that rectangle along its own axes, metres.
        yaw: radians, of its first axis.
        height: median along up, metres.
        height_std: of the surface as one whole, metres.
        area: that the cloud covers, m^2; what stands on it is not in here.
    """

    centre: np.ndarray
    extents: np.ndarray
    yaw: float
    height: float
    height_std: float
    area: float


def level_surfaces(points: np.ndarray, spacing: float, least_area: float = LEAST_AREA) -> tuple[LevelSurface, ...]:
    """Level surfaces of a cloud, the lowest first.

    The cloud is put into cells. Those with nothing `CLEAR` cells above and below them are level, those of a wall are
    not; level neighbours, at most one cell apart in height, are one surface.

    Args:
        points: (M, 3) metres, upright frame.
        spacing: metres between neighbouring points.
        least_area: m^2, of a surface.
    """
    if len(points) == 0:
        return ()
    cell = CELL * spacing
    place = np.floor(points / cell).astype(np.int64)
    place -= place.min(axis=0) - CLEAR - 1  # so that no neighbour's number is that of another column
    _, wide, high = place.max(axis=0) + CLEAR + 2
    number = (place[:, 0] * wide + place[:, 1]) * high + place[:, 2]
    filled, of_point = np.unique(number, return_inverse=True)
    clear = ~_among(filled, filled + CLEAR)[1] & ~_among(filled, filled - CLEAR)[1]
    patch = np.full(len(filled), -1)
    patch[clear] = _patches(filled[clear], int(wide), int(high))
    areas = _columns(patch[clear], filled[clear] // high) * cell**2
    patch_of_point = patch[of_point]
    order = np.argsort(patch_of_point, kind="stable")
    parts = np.split(order, np.searchsorted(patch_of_point[order], np.arange(len(areas))))[1:]
    found = [
        _surface(points[part], float(area), spacing)
        for part, area in zip(parts, areas, strict=True)
        if area >= least_area
    ]
    return tuple(sorted((one for one in found if one is not None), key=lambda one: one.height))


def _patches(cells: np.ndarray, wide: int, high: int) -> np.ndarray:
    """(C,) number of the patch of each of the sorted cells: neighbours in all directions belong together."""
    first, second = [], []
    for aside in (wide, 1, wide + 1, wide - 1, 0):  # one of both directions of each pair
        for up in (-1, 0, 1) if aside else (1,):
            at, there = _among(cells, cells + aside * high + up)
            first.append(np.flatnonzero(there))
            second.append(at[there])
    a, b = np.concatenate(first), np.concatenate(second)
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    return connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(len(cells),) * 2), directed=False)[1]


def _columns(patch: np.ndarray, column: np.ndarray) -> np.ndarray:
    """How many columns each patch covers: a surface between two heights has two cells in many of them."""
    _, first = np.unique(patch * (column.max(initial=0) + 1) + column, return_index=True)
    return np.bincount(patch[first])


def _among(cells: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of (N,) `wanted` cells among sorted `cells`, and whether they are there."""
    at = np.minimum(np.searchsorted(cells, wanted), max(len(cells) - 1, 0))
    return at, cells[at] == wanted if len(cells) else np.zeros(len(wanted), dtype=bool)


def _surface(points: np.ndarray, area: float, spacing: float) -> LevelSurface | None:
    """The surface of a patch's points (M, 3); None where they slope."""
    height = float(np.median(points[:, 2]))
    spread = MEDIAN_TO_STD * float(np.median(np.abs(points[:, 2] - height)))
    if spread > SPREAD:
        return None
    import cv2

    centre, extents, degrees = cv2.minAreaRect(np.ascontiguousarray(points[:, :2], dtype=np.float32))
    # points stand for cells of the cloud's own size, whose heights are even within them
    std = float(np.hypot(spread, spacing / np.sqrt(12.0)))
    return LevelSurface(np.array(centre), np.array(extents) + spacing, float(np.radians(degrees)), height, std, area)
