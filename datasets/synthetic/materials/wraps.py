"""Patterns printed around things: glazes of crockery, wraps of cans, paper labels of bottles. See `textures.py`."""

from __future__ import annotations

import cv2
import numpy as np

from . import prints
from .textures import Colour, plain

HEIGHT, WIDTH = 256, 512  # texels of a wrap; u runs once around the thing


def ground(rng: np.random.Generator, base: Colour) -> np.ndarray:
    """An empty wrap of one colour."""
    return plain(rng, base, 0.02, HEIGHT).repeat(2, axis=1)


def rings(rng: np.random.Generator, image: np.ndarray, ink: Colour) -> None:
    """Level stripes of different widths."""
    for row in rng.integers(20, HEIGHT - 40, int(rng.integers(2, 5))):
        image[row : row + int(rng.integers(6, 26))] = ink


def bars(rng: np.random.Generator, image: np.ndarray, ink: Colour) -> None:
    """Upright stripes, a power of two of them so that the ends meet."""
    period = WIDTH // int(rng.choice((8, 16, 32)))
    image[:, np.arange(WIDTH) % period < period * rng.uniform(0.3, 0.6)] = ink


def slants(rng: np.random.Generator, image: np.ndarray, ink: Colour) -> None:
    """Stripes that wind upwards."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    period = WIDTH // int(rng.choice((8, 16)))
    image[(x + int(rng.choice((-1, 1))) * y) % period < period * rng.uniform(0.25, 0.5)] = ink


def dots(rng: np.random.Generator, image: np.ndarray, ink: Colour) -> None:
    """Spots in shifted rows."""
    radius, columns = int(rng.integers(8, 16)), int(rng.choice((8, 12)))
    step = WIDTH // columns
    for k, row in enumerate(range(28, HEIGHT, 48)):
        for column in range(columns + 1):
            at = (column * step + k % 2 * step // 2, row)
            cv2.circle(image, at, radius, ink, -1, cv2.LINE_AA)


def zigzag(rng: np.random.Generator, image: np.ndarray, ink: Colour) -> None:
    """One to three jagged bands."""
    x = np.arange(WIDTH)
    wave = np.abs(x % 64 - 32)
    y = np.arange(HEIGHT)[:, None]
    for row in rng.choice((30, 90, 150, 210), int(rng.integers(1, 4)), replace=False):
        image[(y > row + wave - 16) & (y < row + wave + 4)] = ink


def dipped(rng: np.random.Generator, image: np.ndarray, ink: Colour) -> None:
    """The lower part in another glaze, with an uneven edge."""
    x = np.linspace(0.0, 2.0 * np.pi, WIDTH, endpoint=False)
    edge = HEIGHT * rng.uniform(0.35, 0.7) + 6.0 * np.sin(3.0 * x + rng.uniform(0.0, 6.0))
    image[np.arange(HEIGHT)[:, None] > edge] = ink


def emblem(rng: np.random.Generator, image: np.ndarray, ink: Colour) -> None:
    """A badge with a word on either side."""
    for centre in (WIDTH // 4, 3 * WIDTH // 4):
        cv2.circle(image, (centre, 118), 58, ink, -1, cv2.LINE_AA)
        cv2.circle(image, (centre, 118), 48, prints.WHITE, 3, cv2.LINE_AA)
        prints.write(image, prints.pick(rng, prints.BRANDS), (centre / WIDTH, 0.46), 0.17, prints.WHITE)


def word(rng: np.random.Generator, image: np.ndarray, ink: Colour) -> None:
    """A large word on either side."""
    text, font = prints.pick(rng, prints.BRANDS), prints.FONTS[int(rng.integers(len(prints.FONTS)))]
    for side in (0.25, 0.75):
        prints.write(image, text, (side, 0.5), 0.34, ink, font)


PATTERNS = (rings, bars, slants, dots, zigzag, dipped, emblem, word)


def glaze(rng: np.random.Generator) -> np.ndarray:
    """The outside of a mug or bowl: a pale ground with a strong pattern, the reverse, or one colour."""
    pale = prints.colour(rng, rng.uniform(0.03, 0.35), rng.uniform(0.8, 0.95))
    strong = prints.colour(rng, rng.uniform(0.5, 0.9), rng.uniform(0.25, 0.7))
    base, ink = (strong, pale) if rng.random() < 0.4 else (pale, strong)
    image = ground(rng, base)
    if rng.random() < 0.85:
        PATTERNS[int(rng.integers(len(PATTERNS)))](rng, image, ink)
    return image


def can_wrap(rng: np.random.Generator) -> np.ndarray:
    """The print of a soda can: a brand on two sides before a pattern."""
    base, second = prints.colour(rng, 0.85, rng.uniform(0.45, 0.8)), prints.colour(rng, 0.5, 0.95)
    image = ground(rng, base)
    pattern = (slants, bars, zigzag, dipped, dots)[int(rng.integers(5))]
    pattern(rng, image, second)
    brand, drink = prints.pick(rng, prints.BRANDS), prints.pick(rng, prints.DRINKS)
    font = prints.FONTS[int(rng.integers(len(prints.FONTS)))]
    for side in (0.25, 0.75):
        middle = int(side * WIDTH)
        cv2.ellipse(image, (middle, 92), (96, 52), 0, 0, 360, base, -1, cv2.LINE_AA)
        cv2.ellipse(image, (middle, 92), (96, 52), 0, 0, 360, prints.WHITE, 3, cv2.LINE_AA)
        prints.write(image, brand, (side, 0.33), 0.28, prints.WHITE, font)
        prints.write(image, drink, (side, 0.48), 0.12, prints.WHITE)
    prints.small_print(rng, image, (0.47, 0.5, 0.53, 0.9), prints.WHITE)
    return image


def paper_label(rng: np.random.Generator) -> np.ndarray:
    """A label around a bottle or jar: coloured or white, a brand on two sides, a picture, small print behind."""
    dark = rng.random() < 0.4
    base = prints.colour(rng, 0.8, 0.45) if dark else prints.colour(rng, 0.12, 0.95)
    ink = prints.WHITE if dark else prints.INK
    accent = prints.colour(rng, 0.8, 0.8)
    image = ground(rng, base)
    edge = int(rng.integers(8, 36))
    image[:edge] = image[-edge:] = accent
    brand, font = prints.pick(rng, prints.BRANDS), prints.FONTS[1 + int(rng.integers(2))]
    for side in (0.25, 0.75):
        middle = int(side * WIDTH)
        cv2.circle(image, (middle, 190), 30, accent, -1, cv2.LINE_AA)
        cv2.circle(image, (middle + 18, 198), 22, prints.colour(rng, 0.7, 0.8), -1, cv2.LINE_AA)
        prints.write(image, brand, (side, 0.36), 0.34, ink, font)
        prints.write(image, prints.pick(rng, prints.DRINKS), (side, 0.54), 0.14, ink)
    prints.small_print(rng, image, (0.45, 0.2, 0.55, 0.85), ink)
    return image
