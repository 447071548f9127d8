"""The scene: which things stand where, and its surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import cycle, islice

import numpy as np

from ..errors import UserError
from ..truth import TrueObject
from .mesh import rotation_z
from .rendering.surfaces import Surfaces, assemble
from .rooms.room import TABLE_HEIGHT, room
from .things.clutter import CLUTTER
from .things.objects import BUILDERS, Model, Part

CLASSES = tuple(BUILDERS)
CAST = ("cup", "cereal box", "bowl", "soda can", "bottle", "cap", "cup", "soda can", "bowl", "cereal box", "cup", "cap")
MAX_OBJECTS = 16
REACH = (0.60, 0.33)  # metres; half axes of the ellipse on the table in which things' centres lie
GAP = 0.008  # metres kept free between the boxes of two things
TRIES = 3000


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """The scene in world coordinates: metres, z up, floor at z = 0, the table about the origin.

    Attributes:
        objects: things of the sample's classes; `surfaces.owner` is their `id`.
        clutter: things of no class, numbered on from the objects.
        surfaces: everything as triangles.
    """

    objects: tuple[TrueObject, ...]
    clutter: tuple[TrueObject, ...]
    surfaces: Surfaces


@lru_cache(maxsize=2)  # it takes half a second, and a sequence is often opened again
def build_world(seed: int, count: int) -> World:
    """`count` things of the sample's classes and the clutter, upright on the table in a furnished room.

    Raises:
        UserError: the table is too small for so many things.
    """
    rng = np.random.default_rng([seed, 0])
    parts = [(part, -1) for part in room(rng)]
    models = [BUILDERS[label](rng) for label in islice(cycle(CAST), count)] + [CLUTTER[label](rng) for label in CLUTTER]
    things: list[TrueObject] = []
    for number, (model, (x, y, yaw)) in enumerate(zip(models, arrange(models, rng), strict=True)):
        centre = np.array([x, y, TABLE_HEIGHT + model.size[2] / 2.0])
        things.append(TrueObject(number, model.label, centre, model.size, yaw))
        parts += [(_placed(part, x, y, yaw), number) for part in model.parts]
    return World(tuple(things[:count]), tuple(things[count:]), assemble(parts))


def _placed(part: Part, x: float, y: float, yaw: float) -> Part:
    mesh = part.mesh.turned(rotation_z(yaw)).moved((x, y, TABLE_HEIGHT))
    return Part(mesh, part.texture, part.gloss, part.sharpness)


def arrange(models: list[Model], rng: np.random.Generator) -> np.ndarray:
    """(N, 3) x, y, yaw on the table so that no two bounding boxes come nearer than `GAP`.

    The largest things choose their places first; each takes the first free one of a random list.
    """
    spots = np.empty((len(models), 3))
    taken: list[np.ndarray] = []
    for k in np.argsort([-m.size[0] * m.size[1] for m in models], kind="stable"):
        for _ in range(TRIES):
            radius, angle, yaw = np.sqrt(rng.random()), rng.uniform(0, 2 * np.pi), rng.uniform(-np.pi, np.pi)
            x, y = REACH[0] * radius * np.cos(angle), REACH[1] * radius * np.sin(angle)
            corners = footprint(x, y, yaw, models[k].size + GAP)
            if not any(overlap(corners, other) for other in taken):
                break
        else:
            raise UserError(
                f"sample:tabletop: expected room for {len(models)} things on the table, found none for the last; "
                "ask for fewer objects or another seed"
            )
        taken.append(corners)
        spots[k] = x, y, yaw
    return spots


def footprint(x: float, y: float, yaw: float, size: np.ndarray) -> np.ndarray:
    """(4, 2) corners of an upright box seen from above."""
    half = size[:2] / 2.0
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    return square @ rotation_z(yaw)[:2, :2].T + (x, y)


def overlap(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two rectangles, (4, 2) corners each, share area (separating axes)."""
    for corners in (a, b):
        for axis in (corners[1] - corners[0], corners[2] - corners[1]):
            p, q = a @ axis, b @ axis
            if p.max() <= q.min() or q.max() <= p.min():
                return False
    return True
