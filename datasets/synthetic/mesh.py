"""Triangle meshes with smooth normals and texture coordinates, and the few shapes everything is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CREASE = np.cos(np.radians(40.0))  # sharper bends of a profile keep their edge


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A triangle mesh in metres, z up.

    Attributes:
        vertices: (V, 3) float64.
        normals: (V, 3) float64, unit, pointing out of the surface.
        uv: (V, 2) float64 texture coordinates, u to the right and v up as seen from outside; 1 is one tile.
        triangles: (T, 3) int64 vertex numbers.
    """

    vertices: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    triangles: np.ndarray

    def moved(self, offset: tuple[float, float, float] | np.ndarray) -> Mesh:
        """Shifted by (3,) metres."""
        return Mesh(self.vertices + np.asarray(offset), self.normals, self.uv, self.triangles)

    def turned(self, rotation: np.ndarray) -> Mesh:
        """Rotated by a (3, 3) matrix about the origin."""
        return Mesh(self.vertices @ rotation.T, self.normals @ rotation.T, self.uv, self.triangles)


def rotation_z(angle: float) -> np.ndarray:
    """(3, 3) rotation by `angle` radians about the up axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def merged(meshes: list[Mesh]) -> Mesh:
    """One mesh of many."""
    first = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.uv for m in meshes]),
        np.concatenate([m.triangles + k for m, k in zip(meshes, first, strict=True)]),
    )


def lathe(profile: np.ndarray | list[tuple[float, float]], segments: int = 48) -> Mesh:
    """Surface of revolution about z.

    Args:
        profile: (M, 2) radius and height in metres, walked so that the outside lies to the right: upwards on an
            outer wall. Bends sharper than 40 degrees stay creased, others are shaded smoothly.
        segments: steps around the axis.
    """
    profile = np.asarray(profile, dtype=float)
    step = np.diff(profile, axis=0)
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    side = np.stack([step[:, 1], -step[:, 0]], axis=1)
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))]
    smooth = np.r_[False, np.sum(side[1:] * side[:-1], axis=1) > CREASE, False]
    before = np.vstack([side[:1], side])
    after = np.vstack([side, side[-1:]])
    mean = before + after
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    # Every segment owns its two rings, so that creases need no special case.
    start = np.where(smooth[:-1, None], mean[:-1], side)
    end = np.where(smooth[1:, None], mean[1:], side)
    ring = np.stack([profile[:-1], profile[1:]], axis=1).reshape(-1, 2)
    ring_normal = np.stack([start, end], axis=1).reshape(-1, 2)
    ring_v = np.stack([length[:-1], length[1:]], axis=1).ravel() / length[-1]
    angle = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    vertices = _around(ring, angle)
    normals = _around(ring_normal, angle)
    uv = np.stack(np.meshgrid(angle / (2.0 * np.pi), ring_v, indexing="ij"), axis=-1).reshape(-1, 2)
    rings = len(ring)
    corner = (np.arange(segments)[:, None] * rings + np.arange(0, rings, 2)).ravel()
    return Mesh(vertices, normals, uv, _quads(corner, corner + rings, corner + rings + 1, corner + 1))


def _around(ring: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """(R, 2) radius and height at (A,) angles to (A * R, 3)."""
    x = np.outer(np.cos(angle), ring[:, 0])
    y = np.outer(np.sin(angle), ring[:, 0])
    return np.stack([x, y, np.broadcast_to(ring[:, 1], x.shape)], axis=-1).reshape(-1, 3)


def _quads(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Corners in counter-clockwise order to (2 Q, 3) triangles."""
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def sheet(points: np.ndarray) -> Mesh:
    """A curved sheet through an (A, B, 3) grid; the outside is where `d/da x d/db` points."""
    rows, columns = points.shape[:2]
    normals = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    uv = np.stack(np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij"), axis=-1)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    triangles = _quads(corner, corner + columns, corner + columns + 1, corner + 1)
    return Mesh(points.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), triangles)


def tube(path: np.ndarray, radius: float, sides: int = 12) -> Mesh:
    """A round tube along an (M, 2) path in the x-z plane, metres; its ends are open."""
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    outward = np.stack([tangent[:, 1], np.zeros(len(path)), -tangent[:, 0]], axis=1)
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    normals = np.cos(angle)[None, :, None] * outward[:, None] + np.sin(angle)[None, :, None] * np.array([0.0, 1.0, 0.0])
    centres = np.stack([path[:, 0], np.zeros(len(path)), path[:, 1]], axis=1)
    bent = sheet(centres[:, None] + radius * normals)
    return Mesh(bent.vertices, normals.reshape(-1, 3), bent.uv, bent.triangles[:, ::-1])  # wound as seen from outside


FACES = {  # normal, u direction, v direction
    "+x": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-x": ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
    "+y": ((0, 1, 0), (-1, 0, 0), (0, 0, 1)),
    "-y": ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    "+z": ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    "-z": ((0, 0, -1), (-1, 0, 0), (0, 1, 0)),
}


def face(size: tuple[float, float, float] | np.ndarray, name: str, tile: float | None = None) -> Mesh:
    """One side of an upright box standing on z = 0 about the z axis.

    Args:
        size: full extents, metres.
        name: one of `FACES`.
        tile: metres a texture tile covers; None stretches one tile over the face.
    """
    half = np.asarray(size, dtype=float) / 2.0
    normal, u, v = (np.array(axis, dtype=float) for axis in FACES[name])
    corners = np.array([-u - v, u - v, u + v, -u + v]) + normal
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    if tile is not None:
        uv *= 2.0 * np.array([np.abs(u) @ half, np.abs(v) @ half]) / tile
    vertices = corners * half + np.array([0.0, 0.0, half[2]])
    return Mesh(vertices, np.tile(normal, (4, 1)), uv, np.array([[0, 1, 2], [0, 2, 3]]))


def box(size: tuple[float, float, float] | np.ndarray, tile: float | None = None, faces: str = "+x-x+y-y+z-z") -> Mesh:
    """An upright box standing on z = 0 about the z axis, or only some of its `faces`."""
    names = [faces[k : k + 2] for k in range(0, len(faces), 2)]
    return merged([face(size, name, tile) for name in names])
