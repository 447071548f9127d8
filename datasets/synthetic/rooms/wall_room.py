"""A long room with a wall full of prints, which are as flat as the wall: the scene of the preset wall."""

from __future__ import annotations

import cv2
import numpy as np

from ..materials import prints, textures
from ..materials.finishes import BIRCH, OAK, WALNUT, stone, tiles
from ..mesh import face
from ..rendering.render import Lights
from ..things.objects import Part
from .layout import Layout
from .shell import Bounds, RoomFinish, shell

ROOM = Bounds((-4.1, 4.1), (-2.0, 1.2))  # metres; the prints are on the +y wall, the camera walks along y = 0
TEXELS = (4096, 1024)  # of the wall: 2.0 and 2.4 mm, as pixels from 1.2 m
PITCH = 0.62  # metres from one column of prints to the next; a view is 1.4 m wide
LOW, HIGH = 0.62, 2.05  # metres above the floor between which prints hang; a view ends at about 0.8 and 1.9
GAP = 0.05  # metres of bare wall about every print, at least
LIGHTS = Lights(
    centres=((1.9, -0.55, 2.35), (-1.9, -0.55, 2.35)),
    powers=((4.6, 4.3, 3.8), (4.0, 4.0, 4.2)),
    sky=(0.22, 0.22, 0.23),
    bounce=0.85,
)


def wall_room(rng: np.random.Generator) -> Layout:
    """Paint and prints differ by `rng`. Nothing can stand in it."""
    paint = textures.plain(rng, prints.colour(rng, 0.08, 0.8), 0.02, 256)
    floor = textures.wood(rng, (120, 92, 66), (196, 164, 126), 1024, planks=8)
    trim, ceiling = textures.plain(rng, prints.WHITE, 0.02), textures.plain(rng, (236, 234, 228), 0.02)
    parts = shell(ROOM, RoomFinish(floor, ceiling, paint, paint, trim), walls="+x-x-y")
    length, _, height = ROOM.size
    wall = face((length, 0.0, height), "-y").moved((0.0, ROOM.y[1], 0.0))
    return Layout((*parts, Part(wall, _printed_wall(rng))), (), LIGHTS)


def _printed_wall(rng: np.random.Generator) -> np.ndarray:
    """(H, W, 3) the whole wall in one picture: what is painted on a plane cannot stand out from it."""
    wide, high = TEXELS
    ground = np.array(prints.colour(rng, 0.08, 0.84), np.float32)
    blotches = 1.0 + 0.02 * textures.layered(rng, (high, wide), (4, 16), 6)
    image = np.clip(ground * blotches[..., None], 0, 255).astype(np.uint8)
    length, _, height = ROOM.size
    scale = np.array([wide / length, high / height])
    for column in range(int(length / PITCH)):
        left = column * PITCH + 0.5 * (length % PITCH)
        split = rng.uniform(0.42, 0.58) * (HIGH - LOW) + LOW
        for low, top in ((LOW, split), (split, HIGH)):
            size = (PITCH, top - low) - rng.uniform(2 * GAP, 5 * GAP, 2)
            corner = np.array((left, low)) + rng.uniform(GAP, (PITCH, top - low) - size - GAP)
            x, y = (int(v) for v in (corner[0] * scale[0], (height - corner[1] - size[1]) * scale[1]))
            w, h = (int(v) for v in size * scale)
            image[y : y + h, x : x + w] = cv2.resize(_print(rng), (w, h), interpolation=cv2.INTER_AREA)
    return image


def _print(rng: np.random.Generator) -> np.ndarray:
    """A picture of one of several kinds, mostly posters."""
    kind = int(rng.integers(10))
    if kind < 5:
        return prints.poster(rng)
    if kind == 5:
        return textures.woven(rng, [prints.colour(rng, 0.45, 0.5), (205, 190, 160), prints.colour(rng, 0.4, 0.75)])
    if kind == 6:
        return textures.wood(rng, *(OAK, WALNUT, BIRCH)[int(rng.integers(3))], planks=4)
    if kind == 7:
        return stone(rng, (70, 70, 76), (200, 196, 188))
    if kind == 8:
        return tiles(rng, prints.colour(rng, 0.5, 0.7), (230, 228, 220), 4)
    words = [prints.pick(rng, choices) for choices in (prints.BRANDS, prints.CEREALS)]
    return prints.cereal_front(rng, prints.colour(rng), words[0], words[1])
