"""Jars and candles, of no class."""

from __future__ import annotations

import numpy as np

from ..materials import prints, textures, wraps
from ..mesh import lathe, merged
from .objects import Model, Part, standing


def jar(rng: np.random.Generator) -> Model:
    """A jar of jam or spice with a lid in another colour."""
    r, h = rng.uniform(0.027, 0.042), rng.uniform(0.075, 0.135)
    filling = textures.plain(rng, prints.colour(rng, 0.7, rng.uniform(0.25, 0.7)), 0.08)
    lid = textures.plain(rng, prints.colour(rng, rng.uniform(0.0, 0.9), rng.uniform(0.3, 0.9)))
    low, high, top = 0.2 * h, 0.66 * h, 0.84 * h
    body = [
        lathe([(0.0, 0.0), (0.9 * r, 0.0), (r, 0.004), (r, low)]),
        lathe([(r, high), (r, 0.78 * h), (0.88 * r, top)]),
    ]
    cover = lathe([(0.88 * r, top), (0.93 * r, top), (0.93 * r, h - 0.001), (0.91 * r, h), (0.0, h)])
    return standing(
        "jar",
        [
            Part(merged(body), filling, 0.5, 80.0),
            Part(lathe([(r, low), (r, high)]), wraps.paper_label(rng), 0.08),
            Part(cover, lid, 0.3),
        ],
    )


def candle(rng: np.random.Generator) -> Model:
    """A thick candle with a wick."""
    r, h = rng.uniform(0.028, 0.042), rng.uniform(0.06, 0.15)
    wax = textures.plain(rng, prints.colour(rng, rng.uniform(0.05, 0.6), rng.uniform(0.6, 0.95)), 0.05, 128)
    side = lathe(
        [(0.0, 0.0), (r, 0.0), (r, h - 0.005), (r - 0.005, h), (0.7 * r, h), (0.5 * r, h - 0.006), (0.0, h - 0.007)]
    )
    wick = lathe([(0.0012, h - 0.008), (0.0012, h + 0.008), (0.0, h + 0.008)], 8)
    return standing("candle", [Part(side, wax, 0.2, 20.0), Part(wick, textures.plain(rng, (30, 28, 26)))])
