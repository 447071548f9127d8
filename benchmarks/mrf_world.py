"""A room of voxels with things on tables and what detectors might say of them: for timing the random field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

VOXEL = 0.01  # m
DENSITY = 3.0  # points per square centimetre
ROUGHNESS = 0.003  # m, standard deviation of points along the normal
TURN = 0.03  # standard deviation of each coordinate of a voxel's normal
CLASSES = 5
BACKGROUND = CLASSES
TABLE = 0.75  # m, height of the tables
VOXELS_PER_CELL = 1.4  # of a surface: it is rough
DISCOUNT = 0.1  # alpha of equation (5)

Footprints = Sequence[tuple[np.ndarray, np.ndarray]]  # centres and half lengths of what hides a plane


@dataclass(frozen=True, slots=True, eq=False)
class VoxelWorld:
    """N voxels, sorted.

    Attributes:
        voxels: (N, 3) int32 cells.
        points: (N, 3) mean positions of their points, in edges of a voxel.
        normals: (N, 3) float32 unit, outwards, with noise.
        truth: (N,) int label; the last is background.
        unary: (N, 6) float32, nats, equation (7).
    """

    voxels: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    truth: np.ndarray
    unary: np.ndarray


@dataclass(slots=True)
class _Surfaces:
    """Points as they are put in; things are boxes of centre and half lengths, for what detectors say around them."""

    rng: np.random.Generator
    points: list[np.ndarray] = field(default_factory=list)
    normals: list[np.ndarray] = field(default_factory=list)
    labels: list[np.ndarray] = field(default_factory=list)
    things: list[tuple[np.ndarray, np.ndarray, int]] = field(default_factory=list)

    def plane(
        self,
        corner: np.ndarray,
        u: np.ndarray,
        v: np.ndarray,
        normal: np.ndarray,
        label: int,
        hidden: Footprints = (),
    ) -> None:
        count = int(np.linalg.norm(u) * np.linalg.norm(v) * 1e4 * DENSITY)
        a, b = self.rng.random((2, count, 1))
        points = corner + a * u + b * v
        for center, half in hidden:
            points = points[(np.abs(points[:, :2] - center[:2]) > half[:2]).any(axis=1)]
        self._put(points, np.tile(normal, (len(points), 1)), label)

    def box(self, center: np.ndarray, half: np.ndarray, label: int) -> None:
        for axis in range(3):
            for side in (-1.0, 1.0) if axis < 2 else (1.0,):  # it stands on something
                normal, u, v = np.zeros((3, 3))
                normal[axis], u[axis - 2], v[axis - 1] = side, 2.0 * half[axis - 2], 2.0 * half[axis - 1]
                self.plane(center + half * normal - (u + v) / 2.0, u, v, normal, label)
        self.things.append((center, half, label))

    def ball(self, center: np.ndarray, radius: float, label: int) -> None:
        directions = self.rng.normal(size=(int(4.0 * np.pi * radius**2 * 1e4 * DENSITY), 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        self._put(center + radius * directions, directions, label)
        self.things.append((center, np.full(3, radius), label))

    def _put(self, points: np.ndarray, normals: np.ndarray, label: int) -> None:
        self.points.append(points + normals * self.rng.normal(0.0, ROUGHNESS, (len(points), 1)))
        self.normals.append(normals)
        self.labels.append(np.full(len(points), label))


def build_world(size: int, seed: int = 0) -> VoxelWorld:
    """About `size` voxels (within a few per cent): a square room with walls 1 m high, tables in it."""
    area = size / VOXELS_PER_CELL * VOXEL**2
    side = (np.sqrt(16.0 + 4.0 * 1.8 * area) - 4.0) / (2.0 * 1.8)  # walls 4 side, the rest 1.8 side^2
    rng = np.random.default_rng(seed)
    surfaces = _Surfaces(rng)
    _furnish(surfaces, float(side))
    points, labels = np.concatenate(surfaces.points), np.concatenate(surfaces.labels)
    cells, first, inverse = np.unique(
        np.floor(points / VOXEL).astype(np.int32), axis=0, return_index=True, return_inverse=True
    )
    means = _means(inverse.ravel(), points / VOXEL)
    normals = _means(inverse.ravel(), np.concatenate(surfaces.normals))
    normals += rng.normal(0.0, TURN, normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    truth = labels[first]
    unary = _detections(rng, cells, points[first], truth, surfaces.things)
    return VoxelWorld(cells, means, normals.astype(np.float32), truth, unary)


def _means(cell: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(C, 3) of the (P, 3) values in each cell."""
    return np.stack([np.bincount(cell, column) for column in values.T], axis=1) / np.bincount(cell)[:, None]


def _furnish(surfaces: _Surfaces, side: float) -> None:
    x, y, z, o = *np.eye(3), np.zeros(3)
    surfaces.plane(o, side * x, side * y, z, BACKGROUND)
    for corner, along, normal in ((o, x, y), (o, y, x), (side * y, x, -y), (side * x, y, -x)):
        surfaces.plane(corner, side * along, z, normal, BACKGROUND)
    for left in np.arange(0.1, side - 0.7, 1.0):
        for front in np.arange(0.1, side - 0.7, 1.4):
            _lay(surfaces, np.array([left, front, TABLE]))


def _lay(surfaces: _Surfaces, corner: np.ndarray) -> None:
    """A table 0.7 m square with four things; its top without what they stand on, which no camera sees."""
    stands = [corner + np.array([x, y, 0.0]) for x in (0.17, 0.53) for y in (0.17, 0.53)]
    halves = surfaces.rng.uniform(0.03, 0.1, (4, 3))
    labels = [(len(surfaces.things) + n) % CLASSES for n in range(4)]
    hidden = [
        (s, h if label < 3 else np.full(3, 0.6 * h[0])) for s, h, label in zip(stands, halves, labels, strict=True)
    ]
    x, y, z = np.eye(3)
    surfaces.plane(corner, 0.7 * x, 0.7 * y, z, BACKGROUND, hidden)
    for stand, half, label in zip(stands, halves, labels, strict=True):
        if label < 3:
            surfaces.box(stand + half[2] * z, half, label)
        else:
            surfaces.ball(stand + half[0] * z, float(half[0]), label)


def _detections(
    rng: np.random.Generator, cells: np.ndarray, points: np.ndarray, truth: np.ndarray, things: list
) -> np.ndarray:
    """(N, 6) costs: detectors fire in boxes around things, more surely on the thing, a wrong one often along with it.

    Noise is of single voxels and of blocks of 6 and 20 cm, as windows give it.
    """
    logits = rng.normal(-4.5, 1.0, (len(cells), CLASSES))
    for center, half, label in things:
        box = np.flatnonzero((np.abs(points - center) < 1.6 * half + VOXEL).all(axis=1))
        on_it, other = truth[box] == label, rng.integers(CLASSES)
        logits[box, label] = np.where(on_it, rng.normal(1.5, 1.2, len(box)), rng.normal(0.5, 1.0, len(box)))
        logits[box, other] = np.maximum(logits[box, other], rng.normal(-0.5, 1.5, len(box)))
    for block in (6, 20):
        _, of = np.unique((cells // block) @ np.array([2**40, 2**20, 1]), return_inverse=True)
        logits += rng.normal(0.0, 0.8, (of.max() + 1, CLASSES))[of]
    probability = 1.0 / (1.0 + np.exp(-logits))
    background = DISCOUNT * (1.0 - probability).min(axis=1, keepdims=True)
    return -np.log(np.concatenate([probability, background], axis=1)).astype(np.float32)
