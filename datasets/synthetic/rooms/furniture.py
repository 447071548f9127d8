"""Furniture to sit at: tables, chairs, sofas, and the boxes that stand about.

A piece stands about the origin with its front towards -y and is then `placed`; what can stand on it moves with it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..mesh import Mesh, box, merged, rotation_z
from ..things.objects import Part
from .layout import Support, SupportKind

EDGE = 0.02  # metres of a surface that stay free along its edges


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Some surfaces and the places for things on them."""

    parts: tuple[Part, ...]
    supports: tuple[Support, ...] = ()

    def placed(self, x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> Piece:
        """Turned by `yaw` radians about z, then moved by metres."""
        turn = rotation_z(yaw)
        parts = tuple(replace(p, mesh=_turned(p.mesh, yaw).moved((x, y, z))) for p in self.parts)
        supports = []
        for s in self.supports:
            across, along = turn[:2, :2] @ s.centre + (x, y)
            centre = (float(across), float(along))
            supports.append(replace(s, centre=centre, yaw=s.yaw + yaw, height=s.height + z))
        return Piece(parts, tuple(supports))

    def under(self, headroom: float) -> Piece:
        """With no more than so many metres of air above its supports."""
        return Piece(self.parts, tuple(replace(s, headroom=min(s.headroom, headroom)) for s in self.supports))


def _turned(mesh: Mesh, yaw: float) -> Mesh:
    return mesh.turned(rotation_z(yaw)) if yaw else mesh


def top_of(
    kind: SupportKind, size: tuple[float, float], height: float, headroom: float = 10.0, edge: float = EDGE
) -> Support:
    """The surface of a piece of `size` at `height`, but for its edges."""
    return Support(kind, (0.0, 0.0), (size[0] - 2 * edge, size[1] - 2 * edge), 0.0, height, headroom)


def table(top: np.ndarray, frame: np.ndarray, size: tuple[float, float], height: float) -> Piece:
    """Top, four legs and the frame under the top; the two textures are of the top and of the rest."""
    x, y, thick = *size, 0.035
    below = height - thick
    board = box((x, y, thick), tile=1.0).moved((0.0, 0.0, below))
    ends = [(sx * (x / 2 - 0.07), sy * (y / 2 - 0.07)) for sx in (-1, 1) for sy in (-1, 1)]
    legs = [box((0.06, 0.06, below), tile=0.7).moved((u, v, 0.0)) for u, v in ends]
    rails = [box((x - 0.2, 0.025, 0.08), tile=0.9).moved((0.0, s * (y / 2 - 0.07), below - 0.08)) for s in (-1, 1)]
    rails += [box((0.025, y - 0.2, 0.08), tile=0.9).moved((s * (x / 2 - 0.07), 0.0, below - 0.08)) for s in (-1, 1)]
    parts = (Part(board, top, 0.12, 18.0), Part(merged([*legs, *rails]), frame, 0.08))
    return Piece(parts, (top_of(SupportKind.TABLE, size, height),))


def chair_mesh() -> Mesh:
    """A chair with a slatted back; the back is at +y."""
    seat = box((0.42, 0.42, 0.03), tile=0.8).moved((0.0, 0.0, 0.44))
    legs = [box((0.035, 0.035, 0.44), tile=0.5).moved((sx * 0.18, sy * 0.18, 0.0)) for sx in (-1, 1) for sy in (-1, 1)]
    posts = [box((0.035, 0.03, 0.46), tile=0.5).moved((s * 0.18, 0.19, 0.47)) for s in (-1, 1)]
    slats = [box((0.33, 0.015, 0.06), tile=0.5).moved((0.0, 0.19, z)) for z in (0.55, 0.68, 0.81)]
    return merged([seat, *legs, *posts, *slats])


def chairs(wood: np.ndarray, places: list[tuple[float, float, float]]) -> Piece:
    """Chairs at x, y, yaw; the back of one at yaw 0 is at +y."""
    chair = chair_mesh()
    standing = [chair.turned(rotation_z(yaw)).moved((x, y, 0.0)) for x, y, yaw in places]
    return Piece((Part(merged(standing), wood, 0.15),))


def sofa(cloth: np.ndarray, cushion: np.ndarray, width: float) -> Piece:
    """Two seats between arms, with a back, and a loose cushion at either end."""
    depth, seat = 0.82, 0.42
    inner = (width - 0.36) / 2
    base = box((width, depth, 0.26), tile=0.5).moved((0.0, 0.0, 0.06))
    back = box((width, 0.20, 0.52), tile=0.5).moved((0.0, depth / 2 - 0.10, 0.30))
    arms = [box((0.18, depth, 0.56), tile=0.5).moved((s * (width / 2 - 0.09), 0.0, 0.04)) for s in (-1, 1)]
    seats = [
        box((inner - 0.01, 0.60, 0.13), tile=0.5).moved((s * inner / 2, -0.10, seat - 0.13)).turned(_nod(1.5))
        for s in (-1, 1)
    ]
    backs = [
        box((inner - 0.03, 0.14, 0.38), tile=0.5).turned(_nod(12.0)).moved((s * inner / 2, 0.17, seat + 0.01))
        for s in (-1, 1)
    ]
    loose = [
        box((0.38, 0.10, 0.36)).turned(_nod(22.0)).turned(rotation_z(s * 0.35)).moved((s * 0.72 * inner, -0.02, seat))
        for s in (-1, 1)
    ]
    return Piece((Part(merged([base, back, *arms, *seats, *backs]), cloth), Part(merged(loose), cushion)))


def _nod(degrees: float) -> np.ndarray:
    """(3, 3) rotation that leans what stands on z = 0 towards +y."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


def crate(texture: np.ndarray, size: np.ndarray | tuple[float, float, float]) -> Piece:
    """A box on the floor."""
    return Piece((Part(box(size, tile=0.6), texture),))


def rug(texture: np.ndarray, size: tuple[float, float]) -> Piece:
    """A flat carpet."""
    return Piece((Part(box((*size, 0.012), tile=0.9), texture),))
