"""A long table before a wall with a shelf above it, and lower things beside: the scene of the preset survey."""

from __future__ import annotations

import numpy as np

from ..materials import finishes, prints, textures
from ..materials.finishes import BIRCH, OAK, WALNUT
from ..rendering.render import Lights
from . import decor
from .furniture import Piece, chairs, crate, rug, table
from .layout import Layout
from .shell import Bounds, RoomFinish, shell
from .storage import bookshelf, floor_place, open_shelf, sideboard, wall_shelf

ROOM = Bounds((-3.0, 3.0), (-2.9, 0.75))  # metres; the table stands at the +y wall
BACK = 0.75
TABLE = (2.0, 0.8, 0.74)  # metres, width, depth and height
WALL_SHELF = 1.12  # metres
PICTURES = (  # x, y, yaw of the wall behind, height of the lower edge
    (-2.2, BACK, 0.0, 1.2), (0.0, BACK, 0.0, 1.62), (-3.0, -0.9, np.pi / 2, 1.0), (-3.0, -2.1, np.pi / 2, 1.1),
    (3.0, -0.6, -np.pi / 2, 1.05), (3.0, -2.0, -np.pi / 2, 1.0), (1.3, ROOM.y[0], np.pi, 1.0),
)  # fmt: skip
LIGHTS = Lights(
    centres=((0.9, -0.75, 2.3), (-1.5, -1.7, 2.4)),
    powers=((4.6, 4.3, 3.8), (2.6, 2.7, 2.9)),
    sky=(0.19, 0.2, 0.22),
    bounce=0.85,
)


def survey_room(rng: np.random.Generator) -> Layout:
    """Materials and small things differ by `rng`."""
    trim, iron = textures.plain(rng, prints.WHITE, 0.02), textures.plain(rng, (52, 52, 56), 0.04)
    paint = textures.plain(rng, prints.colour(rng, 0.10, 0.83), 0.02, 256)
    paper = finishes.wallpaper(rng, prints.colour(rng, 0.08, 0.84), prints.colour(rng, 0.15, 0.70))
    floor = textures.wood(rng, (120, 92, 66), (196, 164, 126), 1024, planks=8)
    finish = RoomFinish(floor, textures.plain(rng, (236, 234, 228), 0.02), paint, paper, trim, feature="+y")
    grains = [textures.wood(rng, *grain) for grain in (OAK, WALNUT, BIRCH)]
    order = rng.permutation(3)
    first, second, third = (grains[k] for k in order)
    carpet = textures.woven(rng, [prints.colour(rng, 0.45, 0.5), (205, 190, 160), prints.colour(rng, 0.4, 0.45)], 16)
    boxes = [textures.woven(rng, [prints.colour(rng, 0.4, 0.55), prints.colour(rng, 0.4, 0.75)], 8) for _ in range(3)]
    curtain = textures.woven(rng, [prints.colour(rng, 0.3, 0.75), (226, 220, 206)], 8)
    shelf = wall_shelf(first, iron, (1.9, 0.26), WALL_SHELF, 0.45).placed(0.0, BACK - 0.13)
    width, depth, height = TABLE
    desk = table(textures.wood(rng, *OAK, 1024, planks=4), second, (width, depth), height)
    pieces = [
        desk.placed(0.0, BACK - 0.02 - depth / 2).under(WALL_SHELF - 0.036 - height),
        shelf,
        open_shelf(third, (0.62, 0.36), (0.06, 0.40)).placed(1.36, BACK - 0.19),
        floor_place(-1.35, 0.25, 0.6, 0.7),
        floor_place(0.0, -0.35, 1.5, 0.5),
        bookshelf(rng, 0.9, 1.8, WALNUT).placed(2.45, BACK - 0.16),
        Piece(sideboard(first, third, iron, (1.1, 0.42, 0.8), 2).parts).placed(-2.3, BACK - 0.22),
        crate(boxes[0], (0.45, 0.4, 0.42)).placed(-2.65, -1.0, 0.15),
        crate(boxes[1], (0.5, 0.4, 0.55)).placed(2.65, -1.35, -0.2),
        crate(boxes[2], (0.42, 0.36, 0.30)).placed(0.4, -2.6, 0.1),
        chairs(second, [(-1.9, -2.5, np.pi + rng.uniform(-0.3, 0.3))]),
        rug(carpet, (2.4, 1.4)).placed(0.0, -1.3),
        decor.window(rng, 1.3, 1.0, 1.05, curtain).placed(-0.9, ROOM.y[0], np.pi),
    ]
    for x, y, yaw, z in PICTURES:
        pieces.append(decor.picture(rng, rng.uniform(0.5, 0.75), rng.uniform(0.5, 0.7), z).placed(x, y, yaw))
    parts = [*shell(ROOM, finish), *(part for piece in pieces for part in piece.parts)]
    return Layout(tuple(parts), tuple(support for piece in pieces for support in piece.supports), LIGHTS)
