"""Procedural surfaces: wood, paint, cloth, leaves.

A texture is (H, W, 3) uint8 RGB with sides that are powers of two and edges that meet, so that it can be tiled;
row 0 is the top (v = 1). Values are display values: light reflected is taken as their square.
"""

from __future__ import annotations

import cv2
import numpy as np

Colour = tuple[int, int, int]


def noise(rng: np.random.Generator, size: tuple[int, int], cells: tuple[int, int]) -> np.ndarray:
    """Smooth periodic noise, (H, W) float32 around 0 with unit variance; `cells` down and across."""
    grid = rng.standard_normal(cells, dtype=np.float32)
    pad = 2
    step = (size[0] // cells[0], size[1] // cells[1])
    padded = np.pad(grid, pad, mode="wrap")
    big = cv2.resize(padded, (padded.shape[1] * step[1], padded.shape[0] * step[0]), interpolation=cv2.INTER_CUBIC)
    field = big[pad * step[0] : pad * step[0] + size[0], pad * step[1] : pad * step[1] + size[1]]
    return (field - field.mean()) / max(float(field.std()), 1e-6)


def layered(
    rng: np.random.Generator, size: tuple[int, int], cells: tuple[int, int], octaves: int, fall: float = 0.6
) -> np.ndarray:
    """Octaves of `noise`, each twice as fine and `fall` times as strong; unit variance."""
    total = np.zeros(size, np.float32)
    for k in range(octaves):
        fine = (min(cells[0] << k, size[0]), min(cells[1] << k, size[1]))
        total += fall**k * noise(rng, size, fine)
    return total / float(total.std())


def blend(dark: Colour, light: Colour, amount: np.ndarray) -> np.ndarray:
    """(H, W) amounts in [0, 1] (clipped) to colours between the two."""
    a = np.clip(amount, 0.0, 1.0)[..., None].astype(np.float32)
    low, high = np.array(dark, np.float32), np.array(light, np.float32)
    return np.clip(low + a * (high - low) + 0.5, 0, 255).astype(np.uint8)


def plain(rng: np.random.Generator, colour: Colour, contrast: float = 0.03, size: int = 64) -> np.ndarray:
    """One colour with faint blotches of the given relative contrast."""
    field = 1.0 + contrast * layered(rng, (size, size), (4, 4), 4)
    return np.clip(np.array(colour) * field[..., None], 0, 255).astype(np.uint8)


def wood(rng: np.random.Generator, dark: Colour, light: Colour, size: int = 512, planks: int = 0) -> np.ndarray:
    """Grain along u. With `planks` > 0 the tile is cut into that many boards with dark joints."""
    shape = (size, size)
    bend = layered(rng, shape, (4, 2), 3)
    rows = np.linspace(0.0, 2.0 * np.pi, size, endpoint=False, dtype=np.float32)[:, None]
    rings = np.sin(9.0 * rows + 1.7 * bend)
    fibre = layered(rng, shape, (64, 2), 3, 0.8)
    pores = noise(rng, shape, (size, 16)) > 1.6
    tone = 0.58 + 0.11 * rings + 0.10 * fibre + 0.04 * bend - 0.22 * pores
    if planks:
        tone += _board_tones(rng, size, planks)
    return blend(dark, light, tone)


def _board_tones(rng: np.random.Generator, size: int, planks: int) -> np.ndarray:
    """(size, size) brightness offsets of boards laid with shifted ends."""
    tone = np.zeros((size, size), np.float32)
    height = size // planks
    for k in range(planks):
        rows = slice(k * height, (k + 1) * height)
        cut = int(rng.integers(size))
        first, second = rng.normal(0.0, 0.10, 2)
        columns = (np.arange(size) - cut) % size
        tone[rows] += np.where(columns < size // 2, first, second)
        tone[rows, (columns < 2) | (np.abs(columns - size // 2) < 1)] -= 0.45
        tone[k * height : k * height + 2] -= 0.45
    return tone


def woven(rng: np.random.Generator, colours: list[Colour], bands: int = 16, size: int = 256) -> np.ndarray:
    """Striped cloth: bands of random colours across v with a visible weave."""
    choice = rng.integers(len(colours), size=bands)
    rows = np.array(colours, np.float32)[np.repeat(choice, size // bands)]
    y, x = np.mgrid[:size, :size]
    weave = 1.0 + 0.09 * (((x >> 1) + (y >> 1)) % 2 * 2 - 1) + 0.05 * layered(rng, (size, size), (32, 32), 3)
    return np.clip(rows[:, None] * weave[..., None], 0, 255).astype(np.uint8)


def leaf(rng: np.random.Generator, colour: Colour, size: int = 64) -> np.ndarray:
    """A leaf: a light midrib along u and side veins."""
    y, x = np.mgrid[:size, :size] / size
    offset = np.abs(y - 0.5)
    veins = np.sin(2.0 * np.pi * (7.0 * x - 6.0 * offset)) > 0.9
    tone = 0.5 + 0.12 * layered(rng, (size, size), (4, 4), 4) + 0.22 * veins + 0.35 * (offset < 0.03)
    dark = (colour[0] * 2 // 3, colour[1] * 2 // 3, colour[2] * 2 // 3)
    light = (min(colour[0] * 3 // 2, 255), min(colour[1] * 3 // 2, 255), min(colour[2] * 3 // 2, 255))
    return blend(dark, light, tone)
