"""Things that nobody named: what is left of a depth image when its large planes are gone (Georgakis et al., III-A)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...datasets.frame import Frame
from .config import ProposalConfig
from .joining import joined
from .mean_shift import mean_shift
from .planes import Planes, find_planes
from .point_grid import PointGrid, point_grid
from .segments import connected_pieces, piece_bounds, renumbered


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """One proposal o_k = {pc_k, m_k}.

    Attributes:
        points: (P, 3) float32 metres, camera axes.
        mask: (H, W) bool.
        xyxy: (4,) pixels, outer edges of the mask: an image spans [0, W] x [0, H].
        centroid: (3,) metres, mean of the points.
    """

    points: np.ndarray
    mask: np.ndarray
    xyxy: np.ndarray
    centroid: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Proposals:
    """N proposals of one image; no pixel belongs to two.

    Attributes:
        labels: (H, W) int32, the proposal of each pixel, -1 for none.
        xyxy: (N, 4) pixels, as `Proposal.xyxy`.
        centroids: (N, 3) metres, camera axes.
        extents: (N, 3) metres along the principal axes of the points, largest first.
        grid: the points that they are made of.
        grid_labels: (h, w) int32, the proposal of each of its points, -1 for none.
        planes: what was removed.
    """

    labels: np.ndarray
    xyxy: np.ndarray
    centroids: np.ndarray
    extents: np.ndarray
    grid: PointGrid
    grid_labels: np.ndarray
    planes: Planes

    def __len__(self) -> int:
        return len(self.xyxy)

    def __getitem__(self, index: int) -> Proposal:
        """The proposal of that number, with its points and mask."""
        if not 0 <= index < len(self):
            raise IndexError(f"there are {len(self)} proposals, asked for {index}")
        points = self.grid.points[self.grid_labels == index]
        return Proposal(points, self.labels == index, self.xyxy[index], self.centroids[index])

    def __iter__(self) -> Iterator[Proposal]:
        return (self[index] for index in range(len(self)))

    @property
    def masks(self) -> np.ndarray:
        """(N, H, W) bool."""
        return self.labels == np.arange(len(self), dtype=np.int32)[:, None, None]


def find_proposals(frame: Frame, config: ProposalConfig | None = None, up: np.ndarray | None = None) -> Proposals:
    """Proposals of a frame, by its depth alone; the same frame gives the same ones.

    Args:
        frame: the image; without a reading of depth there are none.
        config: all numbers.
        up: (3,) in camera axes, any length, where it is known; None takes the accelerometer's, or what the planes say.
    """
    config = ProposalConfig() if config is None else config
    grid = point_grid(frame.depth, frame.intrinsics, config.step(frame.depth.shape[1]), config.near, config.far)
    up = frame.up_at_rest if up is None else up
    planes = find_planes(grid, frame.intrinsics, config.planes, up)
    clusters = cluster_image(grid, planes, config)
    pieces = pieces_of_things(grid, clusters, config)
    return describe(grid, pieces, planes, config)


def cluster_image(grid: PointGrid, planes: Planes, config: ProposalConfig) -> np.ndarray:
    """(h, w) int32: mean-shift cluster of every point on no large plane, -1 elsewhere."""
    left = (grid.depth > 0) & (planes.owner < 0)
    clusters = np.full(left.shape, -1, dtype=np.int32)
    if left.any():
        upright = grid.points[left].astype(np.float64)
        height = upright @ planes.up
        upright -= (1.0 - config.height_share) * height[:, None] * planes.up
        clusters[left] = mean_shift(upright, kernel_radius(grid, planes, config), config.voxels_per_radius)
    return clusters


def pieces_of_things(grid: PointGrid, clusters: np.ndarray, config: ProposalConfig) -> np.ndarray:
    """(h, w) int32: connected pieces of clusters, neighbours of one surface joined; -1 elsewhere."""
    pieces = connected_pieces(clusters, grid.depth, config.jump_share, config.jump)
    pieces = renumbered(pieces, np.bincount(pieces[pieces >= 0]) >= config.min_piece)
    return joined(
        pieces,
        grid,
        least_fold=config.least_fold,
        least_contact=config.least_contact,
        max_extent=config.max_joined,
        jump_share=config.jump_share,
        jump=config.jump,
    )


def kernel_radius(grid: PointGrid, planes: Planes, config: ProposalConfig) -> float:
    """Metres; follows the median depth of the supporting planes, of all planes or points where there are none."""
    depths = planes.depths[planes.is_support] if planes.is_support.any() else planes.depths
    depth = float(np.median(depths)) if len(depths) else float(np.median(grid.depth[grid.depth > 0]))
    return float(np.clip(config.radius_per_depth * depth, config.min_radius, config.max_radius))


def describe(grid: PointGrid, pieces: np.ndarray, planes: Planes, config: ProposalConfig) -> Proposals:
    """Pieces that are large enough, and not too large, with their boxes, centroids and extents."""
    kept = np.bincount(pieces[pieces >= 0]) >= config.min_points
    pieces = renumbered(pieces, kept)
    centroids, extents = _extents(pieces, grid.points, int(kept.sum()))
    kept = (extents[:, 1] >= config.min_extent) & (extents[:, 0] <= config.max_extent)
    pieces = renumbered(pieces, kept)
    boxes = _boxes(pieces, grid, int(kept.sum()))
    return Proposals(grid.enlarged(pieces), boxes, centroids[kept], extents[kept], grid, pieces, planes)


def _extents(labels: np.ndarray, points: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) means of labelled points and (N, 3) extents: 4 standard deviations along the principal axes.

    Of a rectangle seen from the front that is 1.15 times its sides.
    """
    on = labels >= 0
    owner, x = labels[on], points[on].astype(np.float64)
    n = np.bincount(owner, minlength=count)[:, None]
    mean = np.stack([np.bincount(owner, x[:, k], count) for k in range(3)], axis=1) / n
    off = x - mean[owner]
    pairs = [(a, b) for a in range(3) for b in range(3)]
    covariance = np.stack([np.bincount(owner, off[:, a] * off[:, b], count) for a, b in pairs], axis=1) / n
    values = np.linalg.eigvalsh(covariance.reshape(-1, 3, 3))[:, ::-1]
    return mean, 4.0 * np.sqrt(np.maximum(values, 0.0))


def _boxes(pieces: np.ndarray, grid: PointGrid, count: int) -> np.ndarray:
    """(N, 4) pixels, outer edges of each piece."""
    sides, _ = piece_bounds(pieces, grid.points, count)
    sides[:, 2:] += 1
    height, width = grid.shape
    return np.minimum(sides * grid.step, [width, height, width, height]).astype(np.float64)
