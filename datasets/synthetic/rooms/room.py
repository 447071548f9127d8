"""The room around the table: enough corners and edges that every direction of motion is seen."""

from __future__ import annotations

import numpy as np

from ..materials import prints, textures
from ..materials.finishes import OAK, WALNUT
from ..mesh import box, face, merged, rotation_z
from ..things.objects import Part
from .furniture import chairs, table
from .storage import bookshelf

ROOM = (4.5, 4.0, 2.5)  # metres, centred on the origin, floor at z = 0
TABLE_TOP = (1.5, 0.9, 0.035)  # metres
TABLE_HEIGHT = 0.74  # metres, of the surface things stand on
PICTURES = ((0, -0.95), (0, 0.7), (1, 0.15), (2, -0.9), (2, 0.75), (3, -0.5), (3, 1.2))  # wall (+x +y -x -y), metres
CABINET = (1.3, 0.45, 0.85)  # metres, width, depth and height
CABINET_AT = (-ROOM[0] / 2 + CABINET[1] / 2, -0.35)  # metres; it looks along +x


def room(rng: np.random.Generator) -> list[Part]:
    """Everything that is not on the table, in world coordinates."""
    return [*_shell(rng), *_pictures(rng), *_table(rng), *_chairs(rng), *_bookshelf(rng), *_cabinet(rng), *_crates(rng)]


def _shell(rng: np.random.Generator) -> list[Part]:
    """Floor, ceiling, walls, skirting, a door and a rug. The room is a box seen from inside."""
    x, y, z = ROOM
    floor = face((x, y, 0.0), "+z", tile=1.1)
    ceiling = face((x, y, 0.0), "-z", tile=2.0).moved((0.0, 0.0, z))
    walls = [
        face((0.0, y, z), "+x", tile=1.6).moved((-x / 2, 0.0, 0.0)),
        face((0.0, y, z), "-x", tile=1.6).moved((x / 2, 0.0, 0.0)),
        face((x, 0.0, z), "+y", tile=1.6).moved((0.0, -y / 2, 0.0)),
        face((x, 0.0, z), "-y", tile=1.6).moved((0.0, y / 2, 0.0)),
    ]
    paint = textures.plain(rng, (205, 200, 186), 0.02, 256)
    accent = textures.plain(rng, (150, 168, 170), 0.02, 256)
    skirting = merged(
        [box((x, 0.016, 0.09)).moved((0.0, s * (y / 2 - 0.008), 0.0)) for s in (-1, 1)]
        + [box((0.016, y, 0.09)).moved((s * (x / 2 - 0.008), 0.0, 0.0)) for s in (-1, 1)]
    )
    door = box((0.9, 0.04, 2.05), tile=1.0, faces="+x-x-y+z").moved((-1.35, y / 2 - 0.02, 0.0))
    handle = box((0.12, 0.05, 0.02)).moved((-0.99, y / 2 - 0.065, 1.0))
    rug = box((2.3, 1.7, 0.012), tile=0.9).moved((0.1, 0.0, 0.0))
    return [
        Part(floor, textures.wood(rng, (120, 92, 66), (196, 164, 126), 1024, planks=8), 0.08, 12.0),
        Part(ceiling, textures.plain(rng, (236, 234, 228), 0.02)),
        Part(merged(walls[:2]), paint),
        Part(merged(walls[2:]), accent),
        Part(skirting, textures.plain(rng, prints.WHITE, 0.02)),
        Part(door, textures.plain(rng, (226, 222, 210), 0.02)),
        Part(handle, textures.plain(rng, (150, 150, 155)), 0.4),
        Part(rug, textures.woven(rng, [(150, 60, 52), (205, 190, 160), (62, 76, 104), (110, 100, 92)], 16)),
    ]


def _pictures(rng: np.random.Generator) -> list[Part]:
    """Framed posters, hung low enough to be seen from a camera that looks at a table."""
    parts, frames = [], []
    for wall, along in PICTURES:
        width, height = rng.uniform(0.5, 0.8), rng.uniform(0.5, 0.75)
        turn = rotation_z(wall * np.pi / 2)
        at = turn @ np.array([ROOM[wall % 2] / 2 - 0.012, along, rng.uniform(0.95, 1.15)])
        sheet = face((0.0, width, height), "-x").moved((-0.014, 0.0, 0.0))
        frame = box((0.024, width + 0.05, height + 0.05)).moved((0.0, 0.0, -0.025))
        parts.append(Part(sheet.turned(turn).moved(at), prints.poster(rng), 0.05))
        frames.append(frame.turned(turn).moved(at))
    return [*parts, Part(merged(frames), textures.plain(rng, (40, 36, 34)), 0.2)]


def _table(rng: np.random.Generator) -> list[Part]:
    """The table about the origin."""
    grain = textures.wood(rng, *OAK, 1024, planks=4)
    return [*table(grain, textures.wood(rng, *OAK), TABLE_TOP[:2], TABLE_HEIGHT).parts]


def _chairs(rng: np.random.Generator) -> list[Part]:
    """One chair at the far long side of the table and one at either end, each turned a little."""
    places = ((0.25, 0.80, 0.0), (-1.05, 0.05, np.pi / 2), (1.05, 0.0, -np.pi / 2))
    turned = [(x, y, turn + rng.uniform(-0.3, 0.3)) for x, y, turn in places]
    return [*chairs(textures.wood(rng, *WALNUT), turned).parts]


def _bookshelf(rng: np.random.Generator) -> list[Part]:
    """An open shelf against the +y wall, filled with books."""
    return [*bookshelf(rng, 1.1, 1.5, WALNUT).placed(1.30, ROOM[1] / 2 - 0.16).parts]


def _cabinet(rng: np.random.Generator) -> list[Part]:
    """A chest of drawers against the -x wall."""
    width, depth, height = CABINET
    body = box((depth, width, height), tile=1.0)
    fronts, knobs = [], []
    for row in range(3):
        for column in range(2):
            centre = (depth / 2 + 0.009, (column - 0.5) * 0.64, 0.07 + row * 0.255)
            fronts.append(box((0.018, 0.61, 0.235), tile=0.8).moved(centre))
            knobs.append(box((0.03, 0.10, 0.014)).moved((centre[0] + 0.02, centre[1], centre[2] + 0.15)))
    at = (*CABINET_AT, 0.0)
    return [
        Part(body.moved(at), textures.wood(rng, *WALNUT), 0.1),
        Part(merged(fronts).moved(at), textures.wood(rng, *OAK), 0.1),
        Part(merged(knobs).moved(at), textures.plain(rng, (60, 60, 64)), 0.4),
    ]


def _crates(rng: np.random.Generator) -> list[Part]:
    """Boxes on the floor along the +x and -y walls."""
    parts = []
    for x, y, yaw in ((1.9, -0.75, 0.2), (1.85, 0.6, -0.35), (0.9, -1.7, 0.1), (-0.6, -1.65, -0.2)):
        size = rng.uniform((0.4, 0.35, 0.3), (0.6, 0.5, 0.75))
        texture = textures.woven(rng, [prints.colour(rng, 0.4, 0.55), prints.colour(rng, 0.4, 0.75)], 8)
        parts.append(Part(box(size, tile=0.6).turned(rotation_z(yaw)).moved((x, y, 0.0)), texture))
    return parts
