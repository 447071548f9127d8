"""What hangs on walls: pictures, windows with curtains, a clock, a television. Pieces as in `furniture.py`.

Everything hangs on a wall behind it, at y = 0, and looks towards -y; heights are metres above the floor.
"""

from __future__ import annotations

import numpy as np

from ..materials import finishes, prints, textures
from ..materials.textures import Colour
from ..mesh import Mesh, box, face, merged, sheet
from ..things.objects import Part
from .furniture import Piece


def picture(rng: np.random.Generator, width: float, height: float, bottom: float) -> Piece:
    """A framed poster."""
    frame = box((width + 0.05, 0.024, height + 0.05)).moved((0.0, -0.012, bottom - 0.025))
    print_ = face((width, 0.0, height), "-y").moved((0.0, -0.0245, bottom))
    tone: Colour = ((40, 36, 34), (150, 112, 70), (225, 222, 214))[int(rng.integers(3))]
    return Piece((Part(print_, prints.poster(rng), 0.05), Part(frame, textures.plain(rng, tone), 0.2)))


def window(rng: np.random.Generator, width: float, height: float, bottom: float, cloth: np.ndarray) -> Piece:
    """Two casements with a view, a sill, and a curtain on either side."""
    trim = textures.plain(rng, prints.WHITE, 0.02)
    pane = face((width, 0.0, height), "-y").moved((0.0, -0.012, bottom))
    bars = [box((width + 0.14, 0.05, 0.07)).moved((0.0, -0.025, z)) for z in (bottom - 0.07, bottom + height)]
    bars += [box((w, 0.045, height)).moved((x, -0.0225, bottom)) for x, w in _uprights(width)]
    bars.append(box((width, 0.03, 0.03)).moved((0.0, -0.015, bottom + 0.62 * height)))
    sill = box((width + 0.24, 0.13, 0.03)).moved((0.0, -0.065, bottom - 0.1))
    rail = box((width + 0.7, 0.02, 0.025)).moved((0.0, -0.09, bottom + height + 0.12))
    drop = bottom + height + 0.10 - 0.45
    curtains = [_curtain(0.34, drop).moved((s * (width / 2 + 0.12), -0.09, 0.45)) for s in (-1, 1)]
    return Piece(
        (
            Part(pane, finishes.garden(rng), 0.3, 40.0),
            Part(merged([*bars, sill]), trim, 0.1),
            Part(rail, textures.plain(rng, (70, 66, 62)), 0.3),
            Part(merged(curtains), cloth),
        )
    )


def _uprights(width: float) -> list[tuple[float, float]]:
    """x and width of the frame's vertical bars."""
    return [(-width / 2 - 0.035, 0.07), (0.0, 0.06), (width / 2 + 0.035, 0.07)]


def _curtain(width: float, drop: float) -> Mesh:
    """Cloth in folds, from z = 0 up."""
    along = np.linspace(-0.5, 0.5, 60)
    x = np.stack([width * along] * 2, axis=1)
    y = np.stack([0.030 * np.cos(9.0 * np.pi * along), 0.022 * np.cos(9.0 * np.pi * along)], axis=1)
    z = np.tile([0.0, drop], (60, 1))
    return sheet(np.stack([x, y, z], axis=-1))


def clock(rng: np.random.Generator, middle: float) -> Piece:
    """A square wall clock."""
    case = box((0.31, 0.035, 0.31)).moved((0.0, -0.0175, middle - 0.155))
    dial = face((0.28, 0.0, 0.28), "-y").moved((0.0, -0.0355, middle - 0.14))
    return Piece((Part(case, textures.plain(rng, (60, 58, 60)), 0.3), Part(dial, finishes.clock_face(rng), 0.1)))


def television(rng: np.random.Generator, width: float, bottom: float) -> Piece:
    """A flat screen."""
    height = width * 9 / 16
    case = box((width + 0.02, 0.05, height + 0.02)).moved((0.0, -0.045, bottom - 0.01))
    glass = face((width, 0.0, height), "-y").moved((0.0, -0.0705, bottom))
    return Piece((Part(case, textures.plain(rng, (30, 30, 32)), 0.2), Part(glass, finishes.screen(rng), 0.35, 60.0)))
