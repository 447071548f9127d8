"""Potted plants, of no class: arching leaves, upright blades, cacti."""

from __future__ import annotations

import cv2
import numpy as np

from ..materials import prints, textures
from ..mesh import Mesh, lathe, merged, rotation_z, sheet
from .clutter import leaf
from .objects import Model, Part, standing
from .toys import ellipsoid

POTS = ((186, 98, 62), (232, 228, 220), (92, 104, 116), (60, 60, 64), (150, 176, 168))
GREENS = ((52, 116, 44), (70, 130, 70), (96, 132, 52), (60, 100, 74))


def plant(rng: np.random.Generator) -> Model:
    """One of the plants in a pot of its own."""
    r, h = rng.uniform(0.036, 0.056), rng.uniform(0.06, 0.095)
    green = GREENS[int(rng.integers(len(GREENS)))]
    grown = (_arching, _blades, _cactus)[int(rng.integers(3))](rng, r, h, green)
    return standing("plant", [*_pot(rng, r, h), *grown])


def _pot(rng: np.random.Generator, r: float, h: float) -> list[Part]:
    """With or without a brim, filled with soil."""
    if rng.random() < 0.5:
        wall = [(0.0, 0.0), (0.7 * r, 0.0), (0.97 * r, h - 0.018), (1.08 * r, h - 0.018), (1.1 * r, h), (0.98 * r, h)]
    else:
        wall = [(0.0, 0.0), (0.9 * r, 0.0), (0.94 * r, 0.004), (1.03 * r, h), (0.96 * r, h)]
    inner = wall[-1][0]
    soil = [(inner, h), (0.98 * inner, h - 0.010), (0.0, h - 0.006)]
    clay = textures.plain(rng, POTS[int(rng.integers(len(POTS)))], 0.05, 128)
    return [
        Part(lathe(wall), clay, *((0.3, 40.0) if rng.random() < 0.5 else (0.0, 30.0))),
        Part(lathe(soil), textures.plain(rng, (70, 48, 34), 0.25, 128)),
    ]


def _arching(rng: np.random.Generator, r: float, h: float, green: textures.Colour) -> list[Part]:
    leaves = [leaf(rng, h) for _ in range(int(rng.integers(16, 30)))]
    return [Part(merged(leaves), textures.leaf(rng, green), 0.15, 20.0)]


def _blades(rng: np.random.Generator, r: float, h: float, green: textures.Colour) -> list[Part]:
    """Stiff leaves that stand up, with pale edges."""
    blades = []
    for _ in range(int(rng.integers(6, 11))):
        length, lean, width = rng.uniform(0.10, 0.20), rng.uniform(0.02, 0.22), rng.uniform(0.009, 0.016)
        t, across = np.linspace(0.0, 1.0, 12)[:, None], np.linspace(-1.0, 1.0, 5)[None, :]
        half = width * (1.0 - 0.97 * t**3) * (0.75 + 0.5 * t)
        x = 0.35 * r * rng.random() + length * np.sin(lean) * t**1.3 + 0.25 * np.abs(across) * half
        z = h - 0.008 + length * np.cos(lean) * t + 0.0 * across
        blade = sheet(np.stack([x, half * across, z], axis=-1))
        blades.append(blade.turned(rotation_z(rng.uniform(0.0, 2.0 * np.pi))))
    image = textures.blend(green, (150, 176, 110), 0.35 + 0.35 * textures.noise(rng, (64, 64), (2, 16)))
    image[:6] = image[-6:] = (206, 200, 120)
    return [Part(merged(blades), image, 0.2, 25.0)]


def _cactus(rng: np.random.Generator, r: float, h: float, green: textures.Colour) -> list[Part]:
    """A ribbed ball or column."""
    across, tall = rng.uniform(0.6, 0.85) * r, rng.uniform(0.03, 0.075)
    ribs = 2.0 * np.pi * np.arange(128) / 128 * 12
    shade = np.broadcast_to(0.45 + 0.45 * np.cos(ribs), (64, 128))
    image = textures.blend((green[0] // 2, green[1] // 2, green[2] // 2), green, shade)
    for row in range(6, 64, 9):
        for rib in range(12):
            cv2.circle(image, (round(rib * 128 / 12) % 128, row), 1, (236, 226, 190), -1)
    body = _ribbed(ellipsoid((across, across, tall)), 12).moved((0.0, 0.0, h + 0.75 * tall))
    parts = [Part(body, image, 0.05)]
    if rng.random() < 0.5:
        flower = ellipsoid((0.009, 0.009, 0.007)).moved((0.0, 0.0, h + 1.75 * tall))
        parts.append(Part(flower, textures.plain(rng, prints.colour(rng, 0.7, 0.9), 0.05)))
    return parts


def _ribbed(mesh: Mesh, count: int) -> Mesh:
    """With `count` ribs; the normals stay those of the smooth body, the texture shades the furrows."""
    angle = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    swell = 1.0 + 0.05 * np.cos(count * angle)
    return Mesh(
        mesh.vertices * np.stack([swell, swell, np.ones_like(swell)], axis=1), mesh.normals, mesh.uv, mesh.triangles
    )
