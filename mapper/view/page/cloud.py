"""The cloud of a map, made small: even in space, in few bytes, and with the side that each point shows."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from ...trajectory.cloud import voxel_keys
from .facing import facing_codes

LEVELS = 65535  # of a coordinate between its bounds: 0.15 mm in a room of 10 m
TRIES = 12  # sizes of voxel that are tried
ENOUGH = 0.92  # of the points asked for: then the next size of voxel is not looked for
COMPRESSION = 6  # zlib; 9 gains half a percent and takes twice as long


@dataclass(frozen=True, slots=True, eq=False)
class PageCloud:
    """Points for the page.

    Attributes:
        points: (N, 3) metres, upright frame.
        colors: (N, 3) uint8 RGB.
        facing: (N,) uint8 codes of the direction each point faces, see `facing.facing_codes`.
        of: how many points the map's cloud has.
        voxel: metres between neighbours that thinning left at least, on average; 0 where nothing was left out.
    """

    points: np.ndarray
    colors: np.ndarray
    facing: np.ndarray
    of: int
    voxel: float

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) lowest and (3,) highest coordinates, metres."""
        if len(self.points) == 0:
            return np.zeros(3), np.zeros(3)
        return self.points.min(axis=0), self.points.max(axis=0)


def page_cloud(points: np.ndarray, colors: np.ndarray, viewpoints: np.ndarray, count: int) -> PageCloud:
    """At most `count` points of a cloud, evenly spread.

    Args:
        points: (M, 3) metres, upright frame; those that are not finite are left out.
        colors: (M, 3) uint8 RGB.
        viewpoints: (V, 3) where the camera was, same frame; surfaces face the nearest.
        count: largest number of points.
    """
    finite = np.isfinite(points).all(axis=1)
    points, colors = np.asarray(points, dtype=np.float64)[finite], np.asarray(colors, dtype=np.uint8)[finite]
    thin, thin_colors, voxel = thin_out(points, colors, count)
    order = morton_order(thin)
    thin, thin_colors = thin[order], thin_colors[order]
    return PageCloud(thin, thin_colors, facing_codes(thin, viewpoints), len(points), voxel)


def thin_out(points: np.ndarray, colors: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, float]:
    """The means of voxels, which are as small as they can be for at most `count` of them.

    Returns:
        (N, 3) points and (N, 3) uint8 colours, N <= count, and the voxels' size in metres; the cloud itself and 0 where
        it is small enough.
    """
    if len(points) <= count:
        return points, colors, 0.0
    if count <= 0:
        return points[:0], colors[:0], 0.0
    low, high = 0.0, float(np.ptp(points, axis=0).max()) * 2.0 + 1e-3  # one voxel, or eight where it straddles a corner
    size, best = high, (high, voxel_keys(points, high))
    for _ in range(TRIES):
        if low == 0.0:
            size = float(np.sqrt(_area(points) / count))  # a surface's points; the loop finds what it really is
            low = 1e-6
        keys = voxel_keys(points, size)
        found = len(np.unique(keys))
        if found > count:
            low = size
        else:
            high, best = size, (size, keys)
            if found >= ENOUGH * count:
                break
        guess = size * np.sqrt(found / (0.97 * count))  # voxels of a surface grow with the inverse square of the size
        size = float(guess) if low < guess < high else 0.5 * (low + high)
    _, cell, number = np.unique(best[1], return_inverse=True, return_counts=True)
    if len(number) > count:  # fewer than eight points were asked for
        return points[:count], colors[:count], best[0]
    mean = np.stack([np.bincount(cell, points[:, axis]) for axis in range(3)], axis=1) / number[:, None]
    paint = np.stack([np.bincount(cell, colors[:, band]) for band in range(3)], axis=1) / number[:, None]
    return mean, np.round(paint).astype(np.uint8), best[0]


def _area(points: np.ndarray) -> float:
    """m^2: of the hull's sides, very roughly."""
    x, y, z = np.ptp(points, axis=0) + 1e-3
    return float(x * y + y * z + z * x)


def morton_order(points: np.ndarray) -> np.ndarray:
    """(N,) order along a Z curve, in which neighbours of the list are neighbours in space and differ by little."""
    if len(points) == 0:
        return np.empty(0, dtype=np.int64)
    low = points.min(axis=0)
    cells = ((points - low) / max(float(np.ptp(points, axis=0).max()), 1e-9) * 1023.0).astype(np.uint64)
    code = np.zeros(len(points), dtype=np.uint64)
    for axis in range(3):
        value = cells[:, axis]
        for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
            value = (value | (value << np.uint64(shift))) & np.uint64(mask)
        code |= value << np.uint64(axis)
    return np.argsort(code, kind="stable")


def pack(cloud: PageCloud) -> bytes:
    """The cloud as zlib data: planes of N bytes, each a difference to the point before.

    In order: low bytes of x, high bytes of x, the same of y and of z (each coordinate in 1/65535 of its bounds, the
    difference modulo 65536), red, green, blue (differences modulo 256), and the code of the side (as it is). Measured
    on a rendered flat of 230,000 points: 1.63 MB, against 2.14 MB for the same without differences, 2.30 MB undeflated.
    """
    low, high = cloud.bounds
    steps = np.where(high > low, high - low, 1.0) / LEVELS
    places = np.round((cloud.points - low) / steps).astype(np.int64)
    change = np.diff(places, axis=0, prepend=0) % 65536
    planes = [plane for axis in range(3) for plane in (change[:, axis] & 255, change[:, axis] >> 8)]
    planes += list((np.diff(cloud.colors.astype(np.int64), axis=0, prepend=0) % 256).T)
    planes.append(cloud.facing.astype(np.int64))
    return zlib.compress(np.stack(planes).astype(np.uint8).tobytes(), COMPRESSION)
