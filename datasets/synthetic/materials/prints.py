"""Printed pictures: packaging, mug glazes, posters, book spines. Textures as in `textures.py`."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np

from .textures import Colour, blend, layered, plain

BRANDS = ("Solva", "Morning", "Tikka", "Norbi", "Frutti", "Arlo", "Pebble", "Zest", "Kelda", "Umbra")
DRINKS = ("cola", "lemon", "orange", "tonic", "ginger", "cherry")
CEREALS = ("Oat Hoops", "Corn Stars", "Choco Bits", "Wheat Puffs", "Honey Rings", "Rice Pops")
FONTS = (cv2.FONT_HERSHEY_SIMPLEX, cv2.FONT_HERSHEY_TRIPLEX, cv2.FONT_HERSHEY_SCRIPT_SIMPLEX)
WHITE: Colour = (245, 243, 238)
INK: Colour = (35, 32, 38)


def colour(rng: np.random.Generator, saturation: float = 0.75, value: float = 0.75) -> Colour:
    """A random hue."""
    r, g, b = colorsys.hsv_to_rgb(float(rng.random()), saturation, value)
    return int(255 * r), int(255 * g), int(255 * b)


def pick(rng: np.random.Generator, choices: tuple[str, ...]) -> str:
    """One of the words."""
    return choices[int(rng.integers(len(choices)))]


def write(image: np.ndarray, text: str, centre: tuple[float, float], width: float, ink: Colour, font: int = 0) -> None:
    """Draw `text` centred at a fraction (x, y) of the image, `width` of its width wide."""
    (wide, high), _ = cv2.getTextSize(text, font, 1.0, 2)
    scale = width * image.shape[1] / wide
    x = int(centre[0] * image.shape[1] - 0.5 * scale * wide)
    y = int(centre[1] * image.shape[0] + 0.5 * scale * high)
    cv2.putText(image, text, (x, y), font, scale, ink, max(1, round(2 * scale)), cv2.LINE_AA)


def small_print(
    rng: np.random.Generator, image: np.ndarray, area: tuple[float, float, float, float], ink: Colour
) -> None:
    """Lines of unreadable text in the area (x0, y0, x1, y1), fractions of the image."""
    h, w = image.shape[:2]
    x0, x1 = int(area[0] * w), int(area[2] * w)
    for y in range(int(area[1] * h), int(area[3] * h), 8):
        x = x0
        while x < x1 - 4:
            word = int(rng.integers(4, 16))
            cv2.rectangle(image, (x, y), (min(x + word, x1), y + 3), ink, -1)
            x += word + 4


def can_label(rng: np.random.Generator) -> np.ndarray:
    """The wrap of a soda can: brand on two sides, a wave between them."""
    h, w = 256, 512
    base, second = colour(rng, 0.85, 0.7), colour(rng, 0.5, 0.95)
    image = plain(rng, base, 0.02, 256).repeat(2, axis=1)
    x = np.arange(w)
    wave = (h * (0.62 + 0.10 * np.sin(4.0 * np.pi * x / w))).astype(int)
    y = np.arange(h)[:, None]
    image[(y > wave) & (y < wave + 42)] = second
    image[(y > wave + 50) & (y < wave + 56)] = WHITE
    brand, drink, font = pick(rng, BRANDS), pick(rng, DRINKS), FONTS[int(rng.integers(len(FONTS)))]
    for side in (0.25, 0.75):
        write(image, brand, (side, 0.3), 0.3, WHITE, font)
        write(image, drink, (side, 0.48), 0.16, second)
    small_print(rng, image, (0.46, 0.15, 0.54, 0.5), WHITE)
    return image


def bottle_label(rng: np.random.Generator) -> np.ndarray:
    """A paper label around a bottle."""
    image = plain(rng, WHITE, 0.02, 256).repeat(2, axis=1)
    band = colour(rng, 0.7, 0.6)
    image[:28] = band
    image[-40:] = band
    brand = pick(rng, BRANDS)
    for side in (0.25, 0.75):
        cv2.circle(image, (int(side * 512), 80), 26, colour(rng, 0.8, 0.85), -1, cv2.LINE_AA)
        write(image, brand, (side, 0.58), 0.34, INK, FONTS[1])
    small_print(rng, image, (0.44, 0.2, 0.56, 0.8), INK)
    return image


def cereal_front(rng: np.random.Generator, base: Colour, brand: str, name: str) -> np.ndarray:
    """The front of a cereal box: brand, name, and a bowl full of rings."""
    image = plain(rng, base, 0.03, 512)
    sun = colour(rng, 0.5, 0.95)
    cv2.circle(image, (256, 360), 210, sun, -1, cv2.LINE_AA)
    cv2.ellipse(image, (256, 350), (150, 46), 0, 0, 360, WHITE, -1, cv2.LINE_AA)
    cv2.ellipse(image, (256, 360), (150, 120), 0, 0, 180, (70, 95, 160), -1, cv2.LINE_AA)
    for _ in range(45):
        angle, reach = rng.uniform(0, 2 * np.pi), np.sqrt(rng.random())
        at = (int(256 + 128 * reach * np.cos(angle)), int(346 + 32 * reach * np.sin(angle)))
        cv2.circle(image, at, 12, (205, 150, 70), 6, cv2.LINE_AA)
    cv2.rectangle(image, (0, 24), (511, 84), WHITE, -1)
    write(image, brand, (0.5, 0.105), 0.42, base, FONTS[1])
    write(image, name, (0.5, 0.27), 0.84, WHITE, FONTS[1])
    write(image, "500 g", (0.84, 0.955), 0.18, WHITE)
    return image


def cereal_side(rng: np.random.Generator, base: Colour, name: str) -> np.ndarray:
    """A narrow side: name and a table of contents."""
    image = plain(rng, base, 0.03, 256)
    write(image, name, (0.5, 0.1), 0.8, WHITE)
    cv2.rectangle(image, (24, 56), (232, 236), WHITE, -1)
    small_print(rng, image, (0.14, 0.27, 0.86, 0.9), INK)
    return image


def mug_glaze(rng: np.random.Generator) -> np.ndarray:
    """The outside of a mug: plain, banded, dotted or with a word."""
    base = colour(rng, rng.uniform(0.05, 0.7), rng.uniform(0.65, 0.9))
    second = colour(rng, 0.7, 0.5)
    image = plain(rng, base, 0.02, 256).repeat(2, axis=1)
    kind = int(rng.integers(4))
    if kind == 0:
        for row in (60, 84, 170):
            image[row : row + int(rng.integers(6, 18))] = second
    elif kind == 1:
        for k in range(48):
            at = (k % 12 * 43 + k // 12 % 2 * 21 + 10, 50 + k // 12 * 48)
            cv2.circle(image, at, 10, second, -1, cv2.LINE_AA)
    elif kind == 2:
        for side in (0.25, 0.75):
            write(image, pick(rng, BRANDS), (side, 0.5), 0.3, second, FONTS[2])
    else:
        image[150:] = second
    return image


def poster(rng: np.random.Generator) -> np.ndarray:
    """A picture for a wall: a landscape, or coloured shapes with a title."""
    return _landscape(rng) if rng.random() < 0.5 else _shapes(rng)


def _landscape(rng: np.random.Generator) -> np.ndarray:
    size = 256
    rows = np.linspace(0, 1, size)[:, None] * np.ones(size)
    image = blend(colour(rng, 0.4, 0.95), colour(rng, 0.25, 0.95), rows)
    cv2.circle(image, tuple(int(v) for v in rng.integers(50, 200, 2)), 24, (250, 235, 190), -1, cv2.LINE_AA)
    x = np.arange(size)
    for k in range(4):
        ridge = size * (0.4 + 0.15 * k) + 14 * layered(rng, (size, size), (1, 4), 4)[0]
        outline = np.concatenate([np.stack([x, ridge], axis=1), [[size, size], [0, size]]])
        cv2.fillPoly(image, [outline.astype(np.int32)], colour(rng, 0.5, 0.7 - 0.12 * k), cv2.LINE_AA)
    return image


def _shapes(rng: np.random.Generator) -> np.ndarray:
    image = plain(rng, WHITE, 0.02, 256)
    for _ in range(9):
        x, y, a, b = (int(v) for v in rng.integers((20, 20, 12, 12), (236, 190, 60, 60)))
        if rng.random() < 0.5:
            cv2.circle(image, (x, y), a, colour(rng), -1, cv2.LINE_AA)
        else:
            cv2.rectangle(image, (x - a, y - b), (x + a, y + b), colour(rng), -1)
    write(image, pick(rng, BRANDS), (0.5, 0.9), 0.6, INK, FONTS[1])
    return image


def book_spines(rng: np.random.Generator, count: int = 8) -> np.ndarray:
    """`count` spines side by side, each with a title running up it."""
    image = np.empty((256, 256, 3), np.uint8)
    width = 256 // count
    for k in range(count):
        spine = plain(rng, colour(rng, rng.uniform(0.2, 0.8), rng.uniform(0.35, 0.9)), 0.03, 256)[:width].copy()
        write(spine, pick(rng, CEREALS), (0.5, 0.5), 0.55, WHITE)
        image[:, k * width : (k + 1) * width] = cv2.rotate(spine, cv2.ROTATE_90_COUNTERCLOCKWISE)
    return image


def letter(rng: np.random.Generator, character: str) -> np.ndarray:
    """The side of a toy block."""
    image = plain(rng, colour(rng, 0.75, 0.85), 0.03, 128)
    cv2.rectangle(image, (8, 8), (119, 119), WHITE, 4)
    write(image, character, (0.5, 0.5), 0.4, WHITE, FONTS[1])
    return image
