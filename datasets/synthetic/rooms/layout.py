"""What a room offers: its surfaces, where things can stand, what lights it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ..mesh import rotation_z
from ..rendering.render import Lights
from ..things.objects import Part


class SupportKind(StrEnum):
    """What things stand on."""

    TABLE = "table"
    SHELF = "shelf"
    COUNTER = "counter"
    FLOOR = "floor"


@dataclass(frozen=True, slots=True)
class Support:
    """A level rectangle on which things stand.

    Attributes:
        kind: of furniture.
        centre: x and y, metres, world.
        size: full extents along its own axes, metres; all of it is free of furniture.
        yaw: radians about z.
        height: metres above the floor.
        headroom: metres of free air above; things on it must be lower.
    """

    kind: SupportKind
    centre: tuple[float, float]
    size: tuple[float, float]
    yaw: float
    height: float
    headroom: float = 10.0

    def to_world(self, points: np.ndarray) -> np.ndarray:
        """(N, 2) points along its axes from its centre to world x and y, metres."""
        return points @ rotation_z(self.yaw)[:2, :2].T + np.array(self.centre)


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """Rooms with their furniture, world coordinates: metres, z up, floor at z = 0.

    Attributes:
        parts: all surfaces.
        supports: places for things; how many each gets is decided in `placement`, of equal ones the first comes first.
        lights: of all rooms.
    """

    parts: tuple[Part, ...]
    supports: tuple[Support, ...]
    lights: Lights
