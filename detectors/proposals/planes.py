"""The large planes of a depth image: what things stand on, and walls behind them (Georgakis et al., III-A).

The paper removes large horizontal planes. Here other large planes go too, for walls are no things either; what is large
depends on which way up is, since a table is smaller than a wall, and the front of a carton larger than its top.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...datasets.frame import Intrinsics
from .config import PlaneConfig
from .plane_growing import assign_points, cell_moments, grow_planes, join_planes
from .point_grid import PointGrid

IMAGE_UP = np.array([0.0, -1.0, 0.0])
ALIKE = 0.17  # radians: planes further from parallel, or from a right angle, say nothing of each other
EDGE_ON = 0.15  # sine of the angle between a plane and the line of sight
AT_RIGHT_ANGLES = 0.5  # what a wall's area counts for the up that it agrees with, against a floor's


@dataclass(frozen=True, slots=True, eq=False)
class Planes:
    """Large planes n . x = offset, in camera axes.

    Attributes:
        normals: (P, 3) unit vectors towards the camera.
        offsets: (P,) metres, negative.
        areas: (P,) m^2 that are seen.
        depths: (P,) metres, median of each plane's points.
        is_support: (P,) horizontal and seen from above: things stand on it.
        owner: (h, w) int32 of the point grid: the plane of each point, -1 for none.
        up: (3,) unit vector.
    """

    normals: np.ndarray
    offsets: np.ndarray
    areas: np.ndarray
    depths: np.ndarray
    is_support: np.ndarray
    owner: np.ndarray
    up: np.ndarray

    def __len__(self) -> int:
        return len(self.offsets)


def find_planes(grid: PointGrid, intrinsics: Intrinsics, config: PlaneConfig, up: np.ndarray | None = None) -> Planes:
    """The large planes in view, several of any height.

    Args:
        grid: the points.
        intrinsics: of the depth image.
        config: what is large.
        up: (3,) in camera axes, any length; None takes the way up that most of the seen planes agree with among those
            that are plausible for a hand-held camera, and the image's own where there is none.
    """
    cosine = float(np.cos(config.joining_angle))
    moments = cell_moments(grid.points, config.cell)
    least = config.cell_fill * config.cell**2
    cells, sums, fits = grow_planes(moments, least, cosine, config.tolerance, config.sigmas)
    cells, fits = _merged(cells, sums, fits, config)
    normals = fits[:, :3]
    offsets = (normals * fits[:, 3:6]).sum(axis=1)
    owner = assign_points(
        grid.points,
        grid.normals,
        cells,
        normals,
        offsets,
        config.cell,
        config.reach,
        config.tolerance,
        config.sigmas,
        float(np.cos(config.point_angle)),
    )
    areas = _areas(owner, grid, offsets, intrinsics)
    up = _likely_up(normals, areas, config) if up is None else np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
    rise = normals @ up
    horizontal = np.abs(rise) > np.cos(config.horizontal_angle)
    large = areas >= np.where(horizontal, config.min_horizontal, config.min_other)
    kept = np.flatnonzero(large | _lowest(horizontal & (rise > 0), offsets, areas, config))
    number = np.full(len(areas) + 1, -1, dtype=np.int32)  # the last is that of owner -1
    number[kept] = np.arange(len(kept))
    owner = number[owner]
    depths = np.array([np.median(grid.depth[owner == p]) for p in range(len(kept))])
    support = (horizontal & (rise > 0))[kept]
    return Planes(normals[kept], offsets[kept], areas[kept], depths, support, owner, up)


def _merged(
    cells: np.ndarray, sums: np.ndarray, fits: np.ndarray, config: PlaneConfig
) -> tuple[np.ndarray, np.ndarray]:
    """Planes of one square left out; those that lie in one plane, as of a table parted by what stands on it, joined."""
    sizes = np.bincount(cells[cells >= 0], minlength=len(fits))
    order = np.argsort(-sizes, kind="stable")[: int((sizes >= 2).sum())]
    cosine = float(np.cos(config.joining_angle))
    number, fits = join_planes(
        order, sums, fits, cosine, config.tolerance, config.sigmas, config.rms, config.rms_sigmas
    )
    return np.append(number, np.int32(-1))[cells], fits


def _lowest(horizontal: np.ndarray, offsets: np.ndarray, areas: np.ndarray, config: PlaneConfig) -> np.ndarray:
    """(P,) bool: smaller horizontal planes that are no tops of things, for no larger one is a little below them."""
    height = -np.abs(offsets)  # above the camera
    candidates = horizontal & (areas >= config.min_lowest)
    below = height[:, None] - height[None, :]
    has_larger = horizontal & (areas > areas[:, None]) & (below > config.tolerance) & (below < config.stack)
    return candidates & ~has_larger.any(axis=1)


def _areas(owner: np.ndarray, grid: PointGrid, offsets: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """(P,) m^2. A point at depth z, of a plane with offset d, stands for step^2 z^3 / (fx fy |d|).

    |d| / z is how far the plane is from being seen edge-on; below `EDGE_ON` noise makes areas of nothing.
    """
    on = owner >= 0
    z, distance = grid.depth[on].astype(np.float64), np.abs(offsets)[owner[on]]
    each = z**3 / np.maximum(distance, EDGE_ON * z)
    areas = np.bincount(owner[on], weights=each, minlength=len(offsets))
    return areas * grid.step**2 / (intrinsics.fx * intrinsics.fy)


def _likely_up(normals: np.ndarray, areas: np.ndarray, config: PlaneConfig) -> np.ndarray:
    """(3,) up: of the normals that may be a floor's or a table's, the one that the largest areas agree with."""
    big = areas >= config.min_lowest
    normals, areas = normals[big], areas[big]
    possible = normals[normals @ IMAGE_UP > np.cos(config.hand_angle)]
    if not len(possible):
        return IMAGE_UP
    cosines = possible @ normals.T
    off_parallel, off_right = np.arccos(np.clip(cosines, -1.0, 1.0)), np.arcsin(np.clip(np.abs(cosines), 0.0, 1.0))
    agreement = _closeness(off_parallel) + AT_RIGHT_ANGLES * _closeness(off_right)
    best = int(np.argmax(agreement @ areas))
    up = (_closeness(off_parallel[best]) * areas) @ normals
    return up / np.linalg.norm(up)


def _closeness(angle: np.ndarray) -> np.ndarray:
    """1 for no angle, falling to 0 at `ALIKE` radians."""
    return np.maximum(0.0, 1.0 - (angle / ALIKE) ** 2)
