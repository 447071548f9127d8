"""Books: lying, in stacks, standing in rows."""

from __future__ import annotations

import cv2
import numpy as np

from ..materials import prints, textures
from ..mesh import box, face, merged, rotation_z
from .objects import Model, Part, standing

FORMATS = ((0.110, 0.178), (0.129, 0.198), (0.148, 0.210), (0.170, 0.240))  # metres: paperback, B format, A5, hardback
BOARD = 0.002  # metres, thickness of a cover
INSET = 0.003  # metres by which pages are smaller than the cover
TITLES = ("Tides", "North", "Atlas", "Garden", "Signals", "Winter", "Rivers", "Maps", "Bread", "Orbit")


def book(rng: np.random.Generator) -> Model:
    """One lying book, a stack, or some standing in a row."""
    return (_lying, _stack, _row)[int(rng.choice(3, p=(0.3, 0.35, 0.35)))](rng)


def _lying(rng: np.random.Generator) -> Model:
    return standing("book", _volume(rng)[0])


def _stack(rng: np.random.Generator) -> Model:
    """The larger formats below."""
    parts: list[Part] = []
    height = 0.0
    for number in sorted(rng.integers(0, len(FORMATS), int(rng.integers(2, 5))), reverse=True):
        volume, thickness = _volume(rng, int(number))
        turn = rotation_z(rng.normal(0.0, 0.12))
        parts += [Part(p.mesh.turned(turn).moved((0.0, 0.0, height)), p.texture, p.gloss) for p in volume]
        height += thickness
    return standing("book", parts)


def _row(rng: np.random.Generator) -> Model:
    """Upright side by side, the spines towards +x."""
    upright = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    parts: list[Part] = []
    along = 0.0
    for _ in range(int(rng.integers(1, 5))):
        volume, thickness = _volume(rng)
        turned = [p.mesh.turned(upright) for p in volume]
        points = np.concatenate([mesh.vertices for mesh in turned])
        (_, y, z), front = points.min(axis=0), points[:, 0].max()
        shift = np.array([rng.uniform(0.0, 0.008) - front, along - y, -z])
        parts += [Part(mesh.moved(shift), p.texture, p.gloss) for mesh, p in zip(turned, volume, strict=True)]
        along += thickness + 0.0005
    return standing("book", parts)


def _volume(rng: np.random.Generator, number: int | None = None) -> tuple[list[Part], float]:
    """A book on its back: spine towards -x, head towards +y. Returns its parts and its thickness in metres."""
    width, height = FORMATS[int(rng.integers(len(FORMATS))) if number is None else number]
    thickness = float(rng.uniform(0.014, 0.045))
    hue = prints.colour(rng, rng.uniform(0.15, 0.85), rng.uniform(0.25, 0.9))
    title = prints.pick(rng, TITLES)
    size, board = (width, height, thickness), (width, height, BOARD)
    pages = box((width - BOARD - INSET, height - 2.0 * INSET, thickness - 2.0 * BOARD), faces="+x+y-y")
    lower, upper = box(board, faces="+x+y-y+z"), box(board, faces="+x+y-y-z").moved((0.0, 0.0, thickness - BOARD))
    back = box((BOARD, height, thickness - 2.0 * BOARD), faces="+y-y").moved(((BOARD - width) / 2.0, 0.0, BOARD))
    parts = [
        Part(pages.moved(((BOARD - INSET) / 2.0, 0.0, BOARD)), _page_edges(rng)),
        Part(merged([face(size, "+z"), face(size, "-z")]), _cover(rng, hue, title), 0.12),
        Part(merged([lower, upper, back]), textures.plain(rng, hue)),
        Part(face(size, "-x"), _spine(rng, hue, title), 0.12),
    ]
    return parts, thickness


def _page_edges(rng: np.random.Generator) -> np.ndarray:
    """Fine lines along the paper."""
    lines = textures.noise(rng, (64, 64), (32, 1))
    return textures.blend((196, 186, 160), (246, 241, 226), 0.7 + 0.25 * lines)


def _cover(rng: np.random.Generator, hue: textures.Colour, title: str) -> np.ndarray:
    """A title over a picture, bands or shapes."""
    image = textures.plain(rng, hue, 0.03, 256)
    ink = prints.WHITE if sum(hue) < 420 else prints.INK
    style = int(rng.integers(3))
    if style == 0:
        image[90:226, 28:228] = cv2.resize(prints.poster(rng), (200, 136), interpolation=cv2.INTER_AREA)
    elif style == 1:
        for row in range(110, 240, 26):
            image[row : row + int(rng.integers(6, 20))] = prints.colour(rng, 0.5, 0.8)
    else:
        for radius in range(80, 8, -18):
            cv2.circle(image, (128, 165), radius, prints.colour(rng, 0.6, 0.8), -1, cv2.LINE_AA)
    prints.write(image, title, (0.5, 0.17), 0.7, ink, prints.FONTS[1])
    prints.write(image, prints.pick(rng, prints.BRANDS), (0.5, 0.29), 0.3, ink)
    return image


def _spine(rng: np.random.Generator, hue: textures.Colour, title: str) -> np.ndarray:
    """The title along the spine, head on the left; u runs from the head down."""
    image = textures.plain(rng, hue, 0.03, 256)[:64].copy()
    ink = prints.WHITE if sum(hue) < 420 else prints.INK
    band = prints.colour(rng, 0.5, 0.8)
    image[:, 20:30] = image[:, 226:236] = band
    prints.write(image, title, (0.5, 0.5), 0.5, ink, prints.FONTS[1])
    return image
