"""Cereal boxes and soda cans of several makes."""

from __future__ import annotations

import cv2
import numpy as np

from ..materials import prints, textures, wraps
from ..mesh import box
from .objects import Model, Part, can, standing

CEREAL_SIZES = ((0.062, 0.190, 0.285), (0.055, 0.165, 0.235), (0.078, 0.215, 0.300), (0.048, 0.190, 0.250))  # metres
CAN_SIZES = ((0.033, 0.115), (0.033, 0.122), (0.029, 0.146))  # radius and height, metres: 330 ml, 12 oz, sleek 330 ml
CAN_SHARES = (0.45, 0.4, 0.15)


def cereal_box(rng: np.random.Generator) -> Model:
    """A carton; the front looks along x."""
    size = np.array(CEREAL_SIZES[int(rng.integers(len(CEREAL_SIZES)))]) * rng.uniform(0.94, 1.06, 3)
    base = prints.colour(rng, rng.uniform(0.6, 0.9), rng.uniform(0.45, 0.85))
    brand, name = prints.pick(rng, prints.BRANDS), prints.pick(rng, prints.CEREALS)
    fronts = (prints.cereal_front, _burst_front, _split_front)
    front = fronts[int(rng.integers(len(fronts)))](rng, base, brand, name)
    return standing(
        "cereal box", printed_box(size, front, prints.cereal_side(rng, base, name), textures.plain(rng, base))
    )


def printed_box(size: np.ndarray, front: np.ndarray, side: np.ndarray, lid: np.ndarray) -> list[Part]:
    """A carton of (3,) metres with three pictures: along x, along y, above and below."""
    pictures = zip((front, side, lid), ("+x-x", "+y-y", "+z-z"), strict=True)
    return [Part(box(size, faces=faces), picture, 0.1, 25.0) for picture, faces in pictures]


def _burst_front(rng: np.random.Generator, base: textures.Colour, brand: str, name: str) -> np.ndarray:
    """Rays from the middle, a star, and a heap of flakes below."""
    image = textures.plain(rng, base, 0.03, 512)
    y, x = np.mgrid[:512, :512]
    rays = np.floor(np.arctan2(y - 250, x - 256) / (2.0 * np.pi) * 24).astype(int) % 2 == 0
    image[rays] = prints.colour(rng, 0.6, 0.9)
    angle = np.arange(20) * np.pi / 10
    reach = np.where(np.arange(20) % 2 == 0, 200.0, 150.0)
    star = np.stack([256 + reach * np.cos(angle), 250 + 0.8 * reach * np.sin(angle)], axis=1)
    cv2.fillPoly(image, [star.astype(np.int32)], prints.WHITE, cv2.LINE_AA)
    flakes = prints.colour(rng, 0.7, 0.75)
    for column, row in rng.uniform((20, 380), (490, 500), (60, 2)):
        turn, shade = float(rng.uniform(0, 180)), rng.uniform(0.7, 1.15)
        tone = tuple(int(min(255.0, shade * v)) for v in flakes)
        cv2.ellipse(image, (int(column), int(row)), (24, 15), turn, 0, 360, tone, -1, cv2.LINE_AA)
    prints.write(image, brand, (0.5, 0.10), 0.5, prints.WHITE, prints.FONTS[1])
    prints.write(image, name, (0.5, 0.49), 0.56, base, prints.FONTS[1])
    return image


def _split_front(rng: np.random.Generator, base: textures.Colour, brand: str, name: str) -> np.ndarray:
    """White above a slanting coloured field with fruit."""
    image = textures.plain(rng, prints.WHITE, 0.02, 512)
    slope = int(rng.integers(-110, 110))
    field = np.array([(0, 280 - slope), (511, 280 + slope), (511, 511), (0, 511)], np.int32)
    cv2.fillPoly(image, [field], base, cv2.LINE_AA)
    fruit = prints.colour(rng, 0.85, 0.8)
    for column, row in rng.uniform((60, 320), (450, 450), (9, 2)):
        at, radius = (int(column), int(row)), int(rng.integers(22, 46))
        cv2.circle(image, at, radius, fruit, -1, cv2.LINE_AA)
        cv2.circle(image, (at[0] - radius // 3, at[1] - radius // 3), radius // 4, prints.WHITE, -1, cv2.LINE_AA)
    prints.write(image, brand, (0.5, 0.15), 0.8, base, prints.FONTS[1])
    prints.write(image, name, (0.5, 0.31), 0.6, prints.INK)
    prints.small_print(rng, image, (0.1, 0.93, 0.6, 0.98), prints.WHITE)
    return image


def soda_can(rng: np.random.Generator) -> Model:
    """A can of 330 ml or 12 fluid ounces, or a sleek one."""
    r, h = CAN_SIZES[int(rng.choice(len(CAN_SIZES), p=CAN_SHARES))]
    metal = textures.plain(rng, (186, 188, 192), 0.03)
    wrap = prints.can_label(rng) if rng.random() < 0.3 else wraps.can_wrap(rng)
    return standing("soda can", can(r, h * rng.uniform(0.99, 1.01), wrap, metal))
