"""Floors, walls, ceilings and doorways. Rooms are boxes seen from inside, side by side along x."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mesh import box, face, merged
from ..things.objects import Part

DOOR_HEIGHT = 2.05  # metres
TRIM = 0.07  # metres, width of the frame about a doorway


@dataclass(frozen=True, slots=True)
class Bounds:
    """Inside of a room in metres: x and y intervals, and height."""

    x: tuple[float, float]
    y: tuple[float, float]
    height: float = 2.5

    @property
    def size(self) -> tuple[float, float, float]:
        """Extents along x, y, z."""
        return self.x[1] - self.x[0], self.y[1] - self.y[0], self.height

    @property
    def middle(self) -> tuple[float, float, float]:
        """Centre of the floor."""
        return (self.x[0] + self.x[1]) / 2, (self.y[0] + self.y[1]) / 2, 0.0


@dataclass(frozen=True, slots=True, eq=False)
class RoomFinish:
    """Textures of a room; `tile` is how many metres of the floor one texture covers, `feature` names papered walls."""

    floor: np.ndarray
    ceiling: np.ndarray
    paint: np.ndarray
    paper: np.ndarray
    skirting: np.ndarray
    tile: float = 1.1
    feature: str = ""


def shell(bounds: Bounds, finish: RoomFinish, walls: str = "+x-x+y-y") -> list[Part]:
    """Floor, ceiling and those of the four walls that have no doorway, with skirting.

    Args:
        walls: the sides of the room, as `mesh.FACES` names directions; "+x" is the wall at the upper end of x.
    """
    x, y, z = bounds.size
    middle = np.array(bounds.middle)
    names = [walls[k : k + 2] for k in range(0, len(walls), 2)]
    plain, papered, boards = [], [], []
    for name in names:
        inwards = ("-" if name[0] == "+" else "+") + name[1]
        sign = 1.0 if name[0] == "+" else -1.0
        along_x = name[1] == "y"
        size = (x, 0.0, z) if along_x else (0.0, y, z)
        offset = np.array((0.0, sign * y / 2, 0.0) if along_x else (sign * x / 2, 0.0, 0.0))
        pattern, tile = (papered, 0.9) if name in finish.feature else (plain, 1.6)
        pattern.append(face(size, inwards, tile=tile).moved(middle + offset))
        board = box((x, 0.016, 0.09) if along_x else (0.016, y, 0.09))
        boards.append(
            board.moved(middle + offset - sign * np.array((0.0, 0.008, 0.0) if along_x else (0.008, 0.0, 0.0)))
        )
    parts = [
        Part(face((x, y, 0.0), "+z", tile=finish.tile).moved(middle), finish.floor, 0.08, 12.0),
        Part(face((x, y, 0.0), "-z", tile=2.0).moved(middle + np.array([0.0, 0.0, z])), finish.ceiling),
        Part(merged(boards), finish.skirting),
    ]
    parts += [Part(merged(meshes), t) for meshes, t in ((plain, finish.paint), (papered, finish.paper)) if meshes]
    return parts


def partition(
    x: float,
    thickness: float,
    y: tuple[float, float],
    opening: tuple[float, float],
    height: float,
    paints: tuple[np.ndarray, np.ndarray],
    trim: np.ndarray,
) -> list[Part]:
    """A wall between two rooms, about the plane at `x`, with a doorway.

    Args:
        y: ends of the wall, and
        opening: of the doorway, metres.
        paints: on the sides of lower and of higher x.
        trim: texture of the frame, the threshold and the skirting.
    """
    (start, end), (low, high) = y, opening
    spans = [(start, low, 0.0, height), (high, end, 0.0, height), (low, high, DOOR_HEIGHT, height)]
    parts, white = [], []
    for name, paint in zip(("-x", "+x"), paints, strict=True):
        sides = [
            box((thickness, b - a, top - z), tile=1.6, faces=name).moved((x, (a + b) / 2, z)) for a, b, z, top in spans
        ]
        parts.append(Part(merged(sides), paint))
        side = x + (thickness / 2 + 0.01) * (1 if name == "+x" else -1)
        lintel_y, width = (low + high) / 2, high - low
        white += [box((0.02, TRIM, DOOR_HEIGHT)).moved((side, e, 0.0)) for e in (low - TRIM / 2, high + TRIM / 2)]
        white.append(box((0.02, width + 2 * TRIM, TRIM)).moved((side, lintel_y, DOOR_HEIGHT)))
        ends = ((start, low - TRIM), (high + TRIM, end))
        white += [box((0.02, b - a, 0.09)).moved((side, (a + b) / 2, 0.0)) for a, b in ends]
    white += [box((thickness, 0.02, DOOR_HEIGHT)).moved((x, e, 0.0)) for e in (low - 0.01, high + 0.01)]
    white.append(box((thickness, high - low, 0.02), faces="-z").moved((x, (low + high) / 2, DOOR_HEIGHT)))
    white.append(box((thickness, high - low, 0.008)).moved((x, (low + high) / 2, 0.0)))
    parts.append(Part(merged(white), trim, 0.1))
    return parts
