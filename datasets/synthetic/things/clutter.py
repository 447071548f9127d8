"""Things on the table that belong to no class of the sample: what a detector may be wrong about."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..materials import prints, textures
from ..mesh import Mesh, box, lathe, merged, rotation_z, sheet
from .objects import Model, Part, standing


def potted_plant(rng: np.random.Generator) -> Model:
    """A terracotta pot with arching leaves."""
    r, h = 0.05, 0.085
    outer = [(0.0, 0.0), (0.7 * r, 0.0), (0.97 * r, h - 0.018), (1.08 * r, h - 0.018), (1.1 * r, h), (0.98 * r, h)]
    soil = [(0.98 * r, h), (0.95 * r, h - 0.010), (0.0, h - 0.006)]
    leaves = [leaf(rng, h) for _ in range(26)]
    return standing(
        "potted plant",
        [
            Part(lathe(outer), textures.plain(rng, (186, 98, 62), 0.06, 128)),
            Part(lathe(soil), textures.plain(rng, (70, 48, 34), 0.25, 128)),
            Part(merged(leaves), textures.leaf(rng, (52, 116, 44)), 0.15, 20.0),
        ],
    )


def leaf(rng: np.random.Generator, ground: float) -> Mesh:
    """One leaf: rises, then bends outwards."""
    length, lean, width = rng.uniform(0.10, 0.17), rng.uniform(0.15, 1.0), rng.uniform(0.011, 0.018)
    t = np.linspace(0.0, 1.0, 9)
    bend = lean * (0.35 + 1.1 * t)
    step = length / (len(t) - 1)
    along = np.r_[0.0, np.cumsum(step * np.sin(bend[:-1]))]
    up = np.r_[0.0, np.cumsum(step * np.cos(bend[:-1]))]
    half = width * np.sin(np.pi * np.clip(t, 0.04, 0.995)) ** 0.7
    across = np.linspace(-1.0, 1.0, 5)
    y = half[:, None] * across
    x = along[:, None] - 0.3 * np.abs(y) * np.cos(bend)[:, None]
    z = ground - 0.008 + up[:, None] + 0.35 * np.abs(y) * np.sin(bend)[:, None]
    blade = sheet(np.stack([x, y, z], axis=-1)).moved((0.01, 0.0, 0.0))
    return blade.turned(rotation_z(rng.uniform(0.0, 2.0 * np.pi)))


def toy_blocks(rng: np.random.Generator) -> Model:
    """Three lettered cubes, one upon two."""
    side = 0.042
    cube = box((side, side, side))
    places = ((-0.023, 0.0, 0.0, 0.1), (0.024, 0.004, 0.0, -0.15), (0.002, 0.001, side, 0.5))
    parts = [
        Part(cube.turned(rotation_z(yaw)).moved((x, y, z)), prints.letter(rng, "ABCDEFGHKMRST"[int(rng.integers(13))]))
        for x, y, z, yaw in places
    ]
    return standing("toy blocks", parts)


CLUTTER: dict[str, Callable[[np.random.Generator], Model]] = {"potted plant": potted_plant, "toy blocks": toy_blocks}
