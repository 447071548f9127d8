"""Surfaces of rooms: tiles, stone, wallpaper, glass. Textures as in `textures.py`."""

from __future__ import annotations

import cv2
import numpy as np

from .textures import Colour, blend, layered, noise, plain

OAK: tuple[Colour, Colour] = ((116, 82, 50), (205, 164, 112))
WALNUT: tuple[Colour, Colour] = ((72, 45, 30), (156, 106, 70))
BIRCH: tuple[Colour, Colour] = ((172, 140, 100), (228, 204, 166))


def tiles(rng: np.random.Generator, colour: Colour, joint: Colour, across: int, size: int = 512) -> np.ndarray:
    """`across` x `across` ceramic tiles, a power of two, each of its own tone, with joints between them."""
    side = size // across
    tones = rng.normal(0.0, 0.035, (across, across)).repeat(side, axis=0).repeat(side, axis=1)
    tone = 1.0 + tones + 0.02 * layered(rng, (size, size), (8, 8), 4)
    image = np.clip(np.array(colour) * tone[..., None], 0, 255).astype(np.uint8)
    place = np.arange(size) % side < max(side // 32, 2)
    image[place[:, None] | place[None, :]] = joint
    return image


def stone(rng: np.random.Generator, dark: Colour, light: Colour, size: int = 512) -> np.ndarray:
    """Polished stone: clouds with dark and light grains."""
    tone = 0.55 + 0.12 * layered(rng, (size, size), (4, 4), 5)
    grain = noise(rng, (size, size), (size // 2, size // 2))
    tone += 0.3 * (grain > 1.5) - 0.35 * (grain < -1.4)
    return blend(dark, light, tone)


def wallpaper(rng: np.random.Generator, ground: Colour, print_colour: Colour, size: int = 512) -> np.ndarray:
    """Stripes with a row of diamonds in every other one."""
    image = plain(rng, ground, 0.015, size)
    stripe = size // 8
    for column in range(0, 8, 2):
        image[:, column * stripe : column * stripe + 3] = print_colour
        x = column * stripe + 3 * stripe // 2
        for row in range(8):
            y = row * stripe + (stripe // 2 if column % 4 else 0)
            for wrapped in (y, y + size):  # a diamond over the edge goes on at the other
                offsets = np.array([(0, -stripe // 3), (stripe // 5, 0), (0, stripe // 3), (-stripe // 5, 0)], np.int32)
                cv2.fillPoly(image, [offsets + np.array([x, wrapped], np.int32)], print_colour, cv2.LINE_AA)
    return image


def hob(rng: np.random.Generator) -> np.ndarray:
    """Black glass with four cooking zones, seen from above."""
    image = plain(rng, (34, 34, 38), 0.05, 256)
    for x, y, radius in ((72, 80, 44), (184, 80, 34), (72, 184, 34), (184, 180, 48)):
        for ring in (radius, radius - 5):
            cv2.circle(image, (x, y), ring, (120, 118, 116), 2, cv2.LINE_AA)
    for k in range(6):
        cv2.circle(image, (88 + 16 * k, 244), 4, (150, 150, 148), -1, cv2.LINE_AA)
    return image


def garden(rng: np.random.Generator) -> np.ndarray:
    """What is seen through a window by day: sky, trees, a lawn."""
    rows = np.linspace(0.0, 1.0, 256)[:, None] * np.ones(256)
    image = blend((176, 208, 240), (240, 246, 250), 1.6 * rows + 0.12 * layered(rng, (256, 256), (2, 4), 4))
    leaves = layered(rng, (256, 256), (8, 8), 5)
    for line, dark, light in ((130, (92, 122, 92), (150, 178, 132)), (165, (52, 84, 44), (122, 156, 82))):
        crown = line + 26 * layered(rng, (256, 256), (1, 4), 5)[0]
        behind = np.arange(256)[:, None] > crown
        image[behind] = blend(dark, light, 0.5 + 0.25 * leaves)[behind]
    lawn = blend((104, 140, 66), (164, 192, 108), 0.5 + 0.2 * layered(rng, (256, 256), (32, 8), 3))
    image[212:] = lawn[212:]
    return image


def screen(rng: np.random.Generator) -> np.ndarray:
    """A television that is switched off: nearly black with a sheen."""
    rows = np.linspace(0.0, 1.0, 256)[:, None] + np.linspace(0.0, 0.6, 256)
    return blend((26, 27, 31), (58, 60, 68), rows / 1.6 + 0.03 * layered(rng, (256, 256), (2, 2), 3))


def clock_face(rng: np.random.Generator) -> np.ndarray:
    """A wall clock at some time."""
    image = plain(rng, (240, 238, 230), 0.01, 256)
    for hour in range(12):
        x, y = np.sin(hour * np.pi / 6.0), -np.cos(hour * np.pi / 6.0)
        inner, outer = ((int(128 + r * x), int(128 + r * y)) for r in (96, 116))
        cv2.line(image, inner, outer, (30, 30, 34), 7 if hour % 3 == 0 else 3, cv2.LINE_AA)
    minute = rng.uniform(0.0, 12.0 * 60.0)
    for angle, reach, width in ((minute / 60.0 * np.pi / 6.0, 58, 8), (minute * np.pi / 30.0, 88, 5)):
        tip = (int(128 + reach * np.sin(angle)), int(128 - reach * np.cos(angle)))
        cv2.line(image, (128, 128), tip, (30, 30, 34), width, cv2.LINE_AA)
    return image
