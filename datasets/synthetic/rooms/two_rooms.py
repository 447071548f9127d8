"""A kitchen and a living room with a doorway between them: the scene of the presets kitchen and laps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import TypeVar

import numpy as np

from ..materials import finishes, prints, textures
from ..materials.finishes import BIRCH, OAK, WALNUT
from ..materials.textures import Colour
from ..mesh import box, face, merged
from ..rendering.render import Lights
from ..things.objects import Part
from . import decor
from .fittings import HEIGHT, KitchenFinish, counter, cupboards, refrigerator
from .furniture import Piece, chairs, crate, rug, sofa, table
from .layout import Layout
from .shell import Bounds, RoomFinish, partition, shell
from .storage import bookshelf, floor_place, open_shelf, sideboard, wall_shelf

KITCHEN = Bounds((-4.2, 0.0), (-2.1, 2.1))  # metres; the partition takes half its thickness from either room
LIVING = Bounds((0.0, 4.6), (-2.1, 2.1))
PARTITION = 0.12  # metres
DOORWAY = (-0.05, 0.95)  # metres, its ends along y
BACK = 2.1  # metres, y of the wall that the counter and the sideboard stand at
WALL_SHELF, CUPBOARDS = 1.26, 1.62  # metres, heights of the board above the counter and of what hangs above it
# The lamps mirror each other in the partition, so that the floor of the doorway has no seam.
LAMPS = ((-2.1, 0.35, 2.25), (-3.1, -1.1, 2.4), (2.1, 0.35, 2.25), (3.1, -1.1, 2.4))
POWERS = ((4.3, 4.0, 3.5), (2.2, 2.2, 2.2)) * 2
SKY = (0.19, 0.195, 0.21)
BOUNCE = 0.85

T = TypeVar("T")
WEST, SOUTH, EAST = np.pi / 2, np.pi, -np.pi / 2  # yaw of pieces whose back is at that wall


def two_rooms(rng: np.random.Generator) -> Layout:
    """Rooms of one floor plan; materials and small things differ by `rng`."""
    trim = textures.plain(rng, prints.WHITE, 0.02)
    ceiling = textures.plain(rng, (236, 234, 228), 0.02)
    kitchen_paint, living_paint = (textures.plain(rng, prints.colour(rng, 0.10, 0.84), 0.02, 256) for _ in range(2))
    tone = _choose(rng, ((176, 168, 154), (158, 146, 130), (140, 142, 142)))
    kitchen_finish = RoomFinish(
        finishes.tiles(rng, tone, (120, 114, 106), 4), ceiling, kitchen_paint, kitchen_paint, trim, tile=1.4
    )
    print_tone = prints.colour(rng, 0.18, 0.66)
    living_finish = RoomFinish(
        textures.wood(rng, (120, 92, 66), (196, 164, 126), 1024, planks=8),
        ceiling, living_paint, finishes.wallpaper(rng, prints.colour(rng, 0.08, 0.86), print_tone), trim, feature="+x",
    )  # fmt: skip
    pieces = [piece for pair in zip_longest(_kitchen(rng), _living_room(rng)) for piece in pair if piece is not None]
    parts = [
        *shell(KITCHEN, kitchen_finish, "-x+y-y"),
        *shell(LIVING, living_finish, "+x+y-y"),
        *partition(0.0, PARTITION, KITCHEN.y, DOORWAY, KITCHEN.height, (kitchen_paint, living_paint), trim),
    ]
    parts += [part for piece in pieces for part in piece.parts]
    supports = [support for piece in pieces for support in piece.supports]
    return Layout(tuple(parts), tuple(supports), Lights(LAMPS, POWERS, sky=SKY, bounce=BOUNCE, walls=(0.0,)))


def _choose(rng: np.random.Generator, choices: Sequence[T]) -> T:
    return choices[int(rng.integers(len(choices)))]


def _kitchen(rng: np.random.Generator) -> list[Piece]:
    """Those on which things stand come first."""
    fronts: Colour = _choose(rng, ((226, 224, 214), (150, 170, 152), (96, 116, 140), (206, 190, 160)))
    finish = KitchenFinish(
        fronts=textures.plain(rng, fronts, 0.03, 128),
        worktop=finishes.stone(
            rng, *_choose(rng, (((70, 70, 74), (150, 148, 146)), ((150, 140, 126), (224, 214, 200))))
        ),
        steel=textures.plain(rng, (158, 160, 164), 0.04),
        handles=textures.plain(rng, (120, 120, 124), 0.03),
        hob=finishes.hob(rng),
        dark=textures.plain(rng, (40, 40, 44), 0.04),
    )
    wood = textures.wood(rng, *_choose(rng, (OAK, BIRCH)))
    top = textures.wood(rng, *_choose(rng, (OAK, BIRCH)), 1024, planks=4)
    iron = textures.plain(rng, (52, 52, 56), 0.04)
    width = 3.4
    counter_x = KITCHEN.x[0] + width / 2
    splash = face((width, 0.0, CUPBOARDS - HEIGHT), "-y", tile=0.6).moved((counter_x, BACK - 0.004, HEIGHT))
    splash_tiles = finishes.tiles(rng, prints.colour(rng, rng.uniform(0.05, 0.2), 0.88), (210, 208, 202), 4)
    seats = [(x, y, yaw + rng.uniform(-0.25, 0.25)) for x, y, yaw in ((-2.45, -1.42, np.pi), (-1.7, -1.42, np.pi))]
    seats.append((-1.02, -0.75, -np.pi / 2 + rng.uniform(-0.25, 0.25)))
    cloth = textures.woven(rng, [prints.colour(rng, 0.4, 0.6), (222, 214, 196)], 16)
    return [
        table(top, wood, (1.35, 0.8), 0.74).placed(-2.05, -0.75),
        counter(finish, width, -0.55, 1.02, WALL_SHELF - 0.036 - HEIGHT).placed(counter_x, BACK - 0.3),
        wall_shelf(wood, iron, (1.75, 0.24), WALL_SHELF, CUPBOARDS - WALL_SHELF).placed(-3.25, BACK - 0.12),
        open_shelf(wood, (1.25, 0.36), (0.08, 0.44, 0.80, 1.12)).placed(KITCHEN.x[0] + 0.18, -0.35, WEST),
        floor_place(-3.55, -1.55, 0.9, 0.8),
        floor_place(-0.45, -1.50, 0.6, 0.9),
        chairs(textures.wood(rng, *WALNUT), seats),
        cupboards(finish, 2.2, CUPBOARDS, 0.65).placed(-3.1, BACK),
        refrigerator(rng, textures.plain(rng, (214, 214, 212), 0.02), finish).placed(-0.44, BACK - 0.34),
        Piece((Part(splash, splash_tiles, 0.25, 30.0),)),
        Piece((_hood(finish, counter_x + 1.02),)),
        decor.window(rng, 1.3, 1.0, 1.05, cloth).placed(-2.1, -BACK, SOUTH),
        decor.picture(rng, 0.55, 0.7, 1.3).placed(KITCHEN.x[0], -0.7, WEST),
        decor.clock(rng, 1.75).placed(KITCHEN.x[0], 0.46, WEST),
        decor.picture(rng, 0.5, 0.65, 0.95).placed(KITCHEN.x[0], 0.95, WEST),
        decor.picture(rng, 0.6, 0.8, 1.05).placed(-PARTITION / 2, -1.1, EAST),
        decor.picture(rng, 0.6, 0.7, 0.85).placed(-3.62, -BACK, SOUTH),
    ]


def _hood(finish: KitchenFinish, x: float) -> Part:
    """An extractor above the hob."""
    hood = box((0.58, 0.45, 0.07)).moved((x, BACK - 0.225, 1.58))
    chimney = box((0.26, 0.26, KITCHEN.height - 1.65)).moved((x, BACK - 0.13, 1.65))
    return Part(merged([hood, chimney]), finish.steel, 0.35, 20.0)


def _living_room(rng: np.random.Generator) -> list[Piece]:
    """Those on which things stand come first."""
    wood = textures.wood(rng, *_choose(rng, (WALNUT, OAK)))
    top = textures.wood(rng, *_choose(rng, (WALNUT, OAK)), 1024, planks=4)
    iron = textures.plain(rng, (52, 52, 56), 0.04)
    body = prints.colour(rng, rng.uniform(0.15, 0.5), rng.uniform(0.45, 0.7))
    cloth = textures.woven(rng, [body, _paler(body, 1.12)], 32)
    cushion = textures.woven(rng, [prints.colour(rng, 0.6, 0.8), prints.colour(rng, 0.3, 0.85)], 8)
    carpet = textures.woven(rng, [prints.colour(rng, 0.45, 0.55), (205, 190, 160), prints.colour(rng, 0.4, 0.45)], 16)
    curtain = textures.woven(rng, [prints.colour(rng, 0.3, 0.75), (226, 220, 206)], 8)
    basket = textures.woven(rng, [prints.colour(rng, 0.4, 0.55), prints.colour(rng, 0.4, 0.75)], 8)
    pictures = [(1.05, BACK, 0.0, 1.15), (2.15, BACK, 0.0, 1.2), (4.6, 0.05, EAST, 1.42), (4.6, -0.85, EAST, 1.4)]
    pictures += [(0.8, -BACK, SOUTH, 0.8), (4.0, -BACK, SOUTH, 0.85)]
    hung = [
        decor.picture(rng, rng.uniform(0.5, 0.7), rng.uniform(0.5, 0.7), z).placed(x, y, yaw)
        for x, y, yaw, z in pictures
    ]
    return [
        table(top, wood, (1.15, 0.55), 0.44).placed(2.4, -0.55),
        sideboard(wood, top, iron, (1.6, 0.42, 0.78), 3).placed(1.6, BACK - 0.22),
        open_shelf(wood, (1.5, 0.36), (0.08, 0.44, 0.80, 1.14)).placed(LIVING.x[1] - 0.18, -0.2, EAST),
        floor_place(0.75, -1.50, 0.9, 0.9),
        floor_place(4.0, -1.60, 0.8, 0.7),
        bookshelf(rng, 1.1, 1.9, WALNUT).placed(3.6, BACK - 0.16),
        sofa(cloth, cushion, 1.9).placed(2.4, -1.53, SOUTH),
        rug(carpet, (2.3, 1.5)).placed(2.4, -0.5),
        crate(basket, (0.42, 0.42, 0.4)).placed(4.25, 1.05, 0.2),
        decor.television(rng, 0.95, 0.85).placed(PARTITION / 2, -1.15, WEST),
        decor.window(rng, 1.3, 1.0, 1.05, curtain).placed(2.4, -BACK, SOUTH),
        *hung,
    ]


def _paler(colour: Colour, factor: float) -> Colour:
    r, g, b = (min(int(factor * value), 255) for value in colour)
    return r, g, b
