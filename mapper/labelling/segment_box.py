"""The upright box that a thing's points lie on the faces of, turned as they are; none for what is round.

A volume of the graph stands along the map's axes, as an upright cylinder that a detector's boxes enclose: of a cereal
box that is turned by 45 degrees it is right about the room it takes, not about its sides. Points tell those. The
rectangle is searched over its turn by how near points lie to its sides (Zhang et al., Efficient L-shape fitting, 2017,
the closeness criterion, with distances cut off as a robust loss).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .box_config import BoxConfig

BIN = 0.0025  # m, of the histograms in which faces are looked for


@dataclass(frozen=True, slots=True, eq=False)
class SegmentBox:
    """A box about the points of one thing, in the upright frame (z is up).

    Attributes:
        yaw: radians about up, in [0, pi / 2): of its first side from the frame's x axis.
        low: (3,) metres, its least coordinates along its own axes.
        high: (3,) the greatest.
        std: (3,) metres, standard deviation of `size`.
        known: (3,) bool, sides whose both ends were seen; the others are at least as long as here.
        roundness: mean distance of points from the nearest side, over the median of it over all turns: 1 for what is
            round, towards 0 for a box.
    """

    yaw: float
    low: np.ndarray
    high: np.ndarray
    std: np.ndarray
    known: np.ndarray
    roundness: float

    @property
    def size(self) -> np.ndarray:
        """(3,) metres, along its own axes."""
        return self.high - self.low

    @property
    def axes(self) -> np.ndarray:
        """(3, 3) its axes as columns, in the upright frame."""
        return turned(self.yaw)

    @property
    def center(self) -> np.ndarray:
        """(3,) metres, in the upright frame."""
        return self.axes @ ((self.low + self.high) / 2.0)


def fit_box(upright: np.ndarray, voxel: float, config: BoxConfig) -> SegmentBox | None:
    """The box whose faces points lie on; None where they are too few, or on no box.

    Args:
        upright: (M, 3) points of one thing in the upright frame, metres.
        voxel: metres, edge of the voxel that each point stands for.
        config: numbers.
    """
    if len(upright) < config.least_points:
        return None
    walls = _walls(upright, config)
    sample = walls[:: max(1, len(walls) // config.most_points)]
    angles = np.arange(0.0, np.pi / 2.0, config.step)
    misfit = np.array([_misfit(sample[:, :2] @ turned(a)[:2, :2], config) for a in angles])
    best, middle = int(np.argmin(misfit)), float(np.median(misfit))
    roundness = float(misfit[best] / middle) if middle > 0.0 else 1.0
    if roundness > config.round_from:
        return None
    own = upright @ turned(angles[best])
    low, high = np.percentile(own, [config.outside, 100.0 - config.outside], axis=0)
    low, high, scatter = _faces(own, low, high, config)
    known = _known_sides(own, low, high, voxel, config)
    # an end is as sharp as its face is thin, and no sharper than the voxels
    return SegmentBox(float(angles[best]), low, high, np.hypot(scatter, voxel / np.sqrt(6.0)), known, roundness)


def turned(yaw: float) -> np.ndarray:
    """(3, 3) rotation about z; points of the upright frame times it are along a box's own axes."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _walls(upright: np.ndarray, config: BoxConfig) -> np.ndarray:
    """Points between bottom and top, whose own points lie anywhere between the sides; all where few are left."""
    low, high = np.percentile(upright[:, 2], [config.outside, 100.0 - config.outside])
    between = upright[(upright[:, 2] > low + config.face) & (upright[:, 2] < high - config.face)]
    return between if len(between) >= config.least_points else upright


def _misfit(points: np.ndarray, config: BoxConfig) -> float:
    """Mean distance of (M, 2) points from the nearest side of their rectangle; what is far counts as far."""
    low, high = np.percentile(points, [config.outside, 100.0 - config.outside], axis=0)
    distance = np.minimum(np.abs(points - low), np.abs(points - high)).min(axis=1)
    far = max(config.far, config.far_share * float(np.mean(high - low)))
    return float(np.mean(np.minimum(distance, far)))


def _faces(
    own: np.ndarray, low: np.ndarray, high: np.ndarray, config: BoxConfig
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ends of the box where its faces are, and (3,) metres, how far both ends' points scatter together.

    The outermost points of a wall that was seen from many places are those of its worst views; the wall is where they
    are densest. An end without a face, such as where a box stands on the floor, stays where its points end.
    """
    ends, variance = np.stack([low, high]), np.zeros(3)
    for k in range(3):
        for end, inwards in ((0, 1.0), (1, -1.0)):
            depth = inwards * (own[:, k] - ends[end, k])
            middle = _densest(depth, high[k] - low[k], config)
            if middle is not None:
                near = depth[np.abs(depth - middle) <= config.face]
                variance[k] += (1.4826 * float(np.median(np.abs(near - middle)))) ** 2
                ends[end, k] += inwards * float(np.median(near))
    return ends[0], ends[1], np.sqrt(variance)


def _densest(depth: np.ndarray, size: float, config: BoxConfig) -> float | None:
    """Where (M,) depths behind an end, metres, are densest within reach of it; None where they are not denser than in
    the middle of the box, so that there is no face."""
    reach = min(max(config.reach, config.reach_share * size), size / 3.0)
    edges = np.arange(-config.reach, size, BIN)
    count = np.histogram(depth, edges)[0].astype(float)
    width = max(round(config.face / BIN), 1)
    smooth = np.convolve(count, np.bartlett(2 * width + 1) / width, mode="same")
    center = edges[:-1] + BIN / 2.0
    inner = smooth[(center > 0.3 * size) & (center < 0.7 * size)]
    outer = np.where(center <= reach, smooth, 0.0)
    best = int(np.argmax(outer))
    if not len(inner) or outer[best] < config.denser * float(np.median(inner)):
        return None
    return float(center[best])


def _known_sides(own: np.ndarray, low: np.ndarray, high: np.ndarray, voxel: float, config: BoxConfig) -> np.ndarray:
    """(3,) bool: sides of which a face that they bound was seen from end to end.

    A face is looked at in cells of two voxels; the share of them that hold a point says how much of it was seen. A side
    as thin as a face may be one face only, whose other side nobody saw.
    """
    size = np.maximum(high - low, voxel)
    known = np.zeros(3, dtype=bool)
    for k in range(3):
        others = [i for i in range(3) if i != k]
        cells = np.maximum(np.ceil(size[others] / (2.0 * voxel)), 1).astype(int)
        for end in (low[k], high[k]):
            on = own[np.abs(own[:, k] - end) <= config.face][:, others]
            place = ((on - low[others]) / size[others] * cells).astype(int)
            inside = ((place >= 0) & (place < cells)).all(axis=1)
            seen = np.zeros(cells, dtype=bool)
            seen[tuple(place[inside].T)] = True
            if seen.mean() >= config.seen:
                known[others] = True
    return known & (size > 2.0 * config.face)
