"""Where things stand: upright on supports, clear of each other, the closer together the more clutter there is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import UserError
from .config import ClutterLevel
from .mesh import rotation_z
from .rectangles import separations
from .rooms.layout import Support, SupportKind

GAP = 0.006  # metres kept free between the boxes of two things
BEHIND = 0.15  # metres by which a place right behind an object, seen from the nearest viewpoint, counts as farther off
FEW, MANY = 160, 2000  # places tried at random; many only where few leave no choice
FLOOR_SHARE, LOW_SHARE = 0.15, 0.35  # objects on the floor or a shelf below LOW, against one at the height of hands
LOW = 0.6  # metres


@dataclass(frozen=True, slots=True)
class Placement:
    """A thing's place in world coordinates.

    Attributes:
        support: index of the support it stands on.
        x: metres, of the centre of its box.
        y: metres.
        z: metres, of its bottom.
        yaw: radians about z, from -pi to pi.
    """

    support: int
    x: float
    y: float
    z: float
    yaw: float


@dataclass(frozen=True, slots=True)
class Crowding:
    """What a clutter level means; own choices, made so that objects are seen ever less.

    Attributes:
        clutter: things of no class per object.
        huddle: a thing's choice among free places ordered by the distance to the nearest object, for clutter those
            in front of it before those behind: 0 takes the first, 1 the last.
    """

    clutter: float
    huddle: float


CROWDING = {
    ClutterLevel.LOW: Crowding(clutter=0.4, huddle=0.9),
    ClutterLevel.MEDIUM: Crowding(clutter=1.0, huddle=0.2),
    ClutterLevel.HIGH: Crowding(clutter=2.2, huddle=0.0),
}


def clutter_count(objects: int, level: ClutterLevel) -> int:
    """Things of no class that go with so many objects."""
    return round(CROWDING[level].clutter * objects)


def place(
    objects: np.ndarray,
    clutter: np.ndarray,
    supports: tuple[Support, ...],
    level: ClutterLevel,
    rng: np.random.Generator,
    viewpoints: np.ndarray | None = None,
) -> list[Placement]:
    """Places for all objects, then for all clutter, in the order given.

    Objects are dealt to the supports by the square of their area, so that large ones get crowded first; clutter goes
    where objects stand. Where a thing finds no room it takes the next support. The largest things choose first.

    Args:
        objects: (N, 3) extents of the objects' boxes, metres.
        clutter: (M, 3) of the things of no class.
        supports: where things may stand.
        level: how close they stand.
        rng: the only source of chance.
        viewpoints: (V, 2) world x and y from which the scene is seen, metres; None where nobody knows.

    Raises:
        UserError: no room is left for one of them.
    """
    tops = [_Top(support, viewpoints) for support in supports]
    sizes = np.concatenate([np.reshape(objects, (-1, 3)), np.reshape(clutter, (-1, 3))])
    huddle = CROWDING[level].huddle
    placements: list[Placement | None] = [None] * len(sizes)
    count = len(objects)
    for first, last, is_clutter in ((0, count, False), (count, len(sizes), True)):
        for number in first + np.argsort(-sizes[first:last, 0] * sizes[first:last, 1], kind="stable"):
            claims = np.array([top.claim(is_clutter) for top in tops])
            for index in np.argsort(-claims, kind="stable"):
                spot = tops[index].spot(sizes[number], huddle, is_clutter, rng)
                if spot is not None:
                    break
            else:
                raise _no_room(sizes[number], len(sizes), supports)
            tops[index].take(spot, sizes[number], is_clutter)
            placements[number] = _in_world(int(index), supports[index], spot)
    return [placement for placement in placements if placement is not None]


class _Top:
    """A support with what stands on it; positions along its own axes from its centre."""

    def __init__(self, support: Support, viewpoints: np.ndarray | None) -> None:
        self._half = np.array(support.size) / 2.0
        self._headroom = support.headroom
        self._weight = (support.size[0] * support.size[1]) ** 2
        if support.kind is SupportKind.FLOOR:
            self._weight *= FLOOR_SHARE
        elif support.kind is SupportKind.SHELF and support.height < LOW:
            self._weight *= LOW_SHARE
        self._taken = np.empty((0, 5))  # x, y, yaw, half extents
        self._objects = self._clutter = 0
        self._views = None if viewpoints is None else (viewpoints - support.centre) @ rotation_z(support.yaw)[:2, :2]

    def claim(self, is_clutter: bool) -> float:
        """Highest for the support that the next thing goes to, as seats are dealt by the method of D'Hondt."""
        if is_clutter:
            return (self._objects + 0.01 * self._weight) / (self._clutter + 1)
        return self._weight / (self._objects + 1)

    def spot(self, size: np.ndarray, huddle: float, is_clutter: bool, rng: np.random.Generator) -> np.ndarray | None:
        """(3,) x, y and yaw of a free place, or None where there is none."""
        if size[2] > self._headroom:
            return None
        for tries in (FEW, MANY):
            places = self._anywhere(size, tries, rng)
            apart = separations(places, self._taken)  # objects first, then clutter
            free = np.flatnonzero(apart.min(axis=1, initial=np.inf) >= GAP)
            if len(free):
                off = apart[free, : self._objects]
                if is_clutter and self._views is not None:
                    off = off + BEHIND * self._behind(places[free, :2], self._views)
                order = np.argsort(off.min(axis=1, initial=np.inf), kind="stable")
                return places[free[order[int(huddle * (len(free) - 1))]], :3]
        return None

    def _anywhere(self, size: np.ndarray, tries: int, rng: np.random.Generator) -> np.ndarray:
        """(N, 5) up to `tries` rectangles as in `separations` that lie inside."""
        yaw = rng.uniform(-np.pi, np.pi, tries)
        c, s = np.abs(np.cos(yaw)), np.abs(np.sin(yaw))
        reach = np.stack([c * size[0] + s * size[1], s * size[0] + c * size[1]], axis=1) / 2.0
        room = self._half - reach
        at = rng.uniform(-1.0, 1.0, (tries, 2)) * room
        half = np.broadcast_to(size[:2] / 2.0, (tries, 2))
        return np.column_stack([at, yaw, half])[np.all(room >= 0.0, axis=1)]

    def _behind(self, at: np.ndarray, views: np.ndarray) -> np.ndarray:
        """(N, O) from 0 for places before an object to 1 for those behind it, as its nearest viewpoint has it."""
        objects = self._taken[: self._objects, :2]
        to_views = views[None] - objects[:, None]
        nearest = np.argmin(np.linalg.norm(to_views, axis=2), axis=1)
        ahead = to_views[np.arange(len(objects)), nearest]
        offset = at[:, None] - objects[None]
        lengths = np.linalg.norm(offset, axis=2) * np.linalg.norm(ahead, axis=1)
        return 0.5 - 0.5 * np.sum(offset * ahead, axis=2) / np.maximum(lengths, 1e-9)

    def take(self, spot: np.ndarray, size: np.ndarray, is_clutter: bool) -> None:
        self._taken = np.vstack([self._taken, np.append(spot, size[:2] / 2.0)])
        self._clutter += is_clutter
        self._objects += not is_clutter


def _in_world(index: int, support: Support, spot: np.ndarray) -> Placement:
    x, y = support.to_world(spot[None, :2])[0]
    yaw = (support.yaw + spot[2] + np.pi) % (2.0 * np.pi) - np.pi
    return Placement(index, float(x), float(y), support.height, float(yaw))


def _no_room(size: np.ndarray, count: int, supports: tuple[Support, ...]) -> UserError:
    kinds = " and ".join(dict.fromkeys(support.kind for support in supports)) or "no support"
    extent = " x ".join(f"{side:.2f}" for side in size)
    return UserError(
        f"synthetic scene: expected room for {count} things on {kinds}, found none for one of {extent} m; "
        "ask for fewer objects, less clutter, another seed, or smaller meshes"
    )
