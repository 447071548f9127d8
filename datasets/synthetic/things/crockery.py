"""Coffee mugs and bowls of several outlines."""

from __future__ import annotations

import numpy as np

from ..materials import prints, textures, wraps
from ..mesh import Mesh, lathe, merged, tube
from .objects import Model, Part, arc, standing

GLAZED = (0.45, 60.0)  # gloss and sharpness


def coffee_mug(rng: np.random.Generator) -> Model:
    """A straight, tapered, bulging or short wide mug with its handle towards +x."""
    shape = int(rng.integers(4))
    r, h = ((0.041, 0.096), (0.044, 0.1), (0.042, 0.092), (0.050, 0.076))[shape] * rng.uniform(0.92, 1.08, 2)
    t = np.linspace(0.0, 1.0, 14)
    widths = (np.ones_like(t), 0.7 + 0.3 * t, 0.82 + 0.55 * t - 0.37 * t * t, 0.72 + 0.28 * np.sqrt(t))
    radius, height = r * widths[shape], 0.004 + (h - 0.006) * t
    outer = np.vstack([(radius[0] - 0.005, 0.0), np.stack([radius, height], axis=1)])
    low, high = rng.uniform(0.16, 0.24), rng.uniform(0.78, 0.88)
    at = np.interp([low, high], t, radius)
    glaze, inside = wraps.glaze(rng), _lining(rng)
    grip = inside if rng.random() < 0.25 else np.ascontiguousarray(glaze[96:160, 96:160])
    return standing(
        "coffee mug",
        [
            *_shell(outer, 0.004, glaze, inside),
            Part(_handle(rng, at - 0.003, np.array([low, high]) * h), grip, *GLAZED),
        ],
    )


def _handle(rng: np.random.Generator, radius: np.ndarray, height: np.ndarray) -> Mesh:
    """From the wall at one (radius, height) to the wall at the other: round as a C, or square as a D."""
    reach, power = rng.uniform(0.024, 0.033), rng.choice((1.0, 0.55))
    angle = np.radians(np.linspace(-90.0, 90.0, 22))
    out = reach * np.abs(np.cos(angle)) ** power
    up = np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** power
    share = (1.0 + up) / 2.0
    wall, at = (ends[0] + share * (ends[1] - ends[0]) for ends in (radius, height))
    return tube(np.stack([wall + out, at], axis=1), rng.uniform(0.0045, 0.0065))


def bowl(rng: np.random.Generator) -> Model:
    """A deep, round, conical or flat bowl on a foot."""
    shape = int(rng.integers(4))
    r, h = ((0.070, 0.078), (0.078, 0.064), (0.080, 0.070), (0.085, 0.053))[shape] * rng.uniform(0.9, 1.1, 2)
    foot = rng.uniform(0.40, 0.52) * r
    angle = np.radians(np.linspace(0.0, 90.0, 16))
    power = (0.75, 1.0, 1.6, 0.9)[shape]  # of an arc's height: below 1 the walls stand up, above 1 they slope
    radius, height = foot + (r - foot) * np.sin(angle), 0.008 + (h - 0.010) * (1.0 - np.cos(angle)) ** power
    stand = [(foot - 0.006, 0.0), (foot - 0.001, 0.0), (foot, 0.004)]
    outer = np.vstack([stand, np.stack([radius, height], axis=1)])
    glaze = wraps.glaze(rng)
    inside = np.ascontiguousarray(glaze[:64, :64]) if rng.random() < 0.3 else _lining(rng)
    return standing("bowl", _shell(outer, 0.0045, glaze, inside))


def _lining(rng: np.random.Generator) -> np.ndarray:
    hue = prints.WHITE if rng.random() < 0.6 else prints.colour(rng, rng.uniform(0.1, 0.5), rng.uniform(0.7, 0.95))
    return textures.plain(rng, hue, 0.02)


def _shell(outer: np.ndarray, wall: float, glaze: np.ndarray, inside: np.ndarray) -> list[Part]:
    """A vessel `wall` metres thick from the (M, 2) radius and height of its outside, foot to rim."""
    along = np.gradient(outer, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    within = outer + wall * np.stack([-along[:, 1], along[:, 0]], axis=1)
    floor = outer[:, 1].min() + 2.0 * wall
    within = within[(within[:, 1] > floor) & (within[:, 0] > 0.002)]
    middle, half = (outer[-1] + within[-1]) / 2.0, (outer[-1, 0] - within[-1, 0]) / 2.0
    rim = arc((middle[0], outer[-1, 1]), (half, 0.002), 0, 180, 6)
    bottom = lathe(np.vstack([(0.0, outer[0, 1] + 0.001), outer[0]]))
    lining = lathe(np.vstack([within[::-1], (0.0, floor)]))
    return [
        Part(lathe(outer, 64), glaze, *GLAZED),
        Part(merged([bottom, lathe(rim, 64), lining]), inside, *GLAZED),
    ]
