"""Furniture to put things in and on: shelves, bookcases, sideboards. Pieces as in `furniture.py`."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..materials import prints, textures
from ..materials.textures import Colour
from ..mesh import Mesh, box, face, merged
from ..things.objects import Part
from .furniture import EDGE, Piece, top_of
from .layout import Support, SupportKind

BOARD = 0.024  # metres, thickness
WIDEST = 0.8  # metres that a shelf spans without an upright


def open_shelf(wood: np.ndarray, size: tuple[float, float], heights: tuple[float, ...]) -> Piece:
    """Boards between uprights before a back panel; things can stand on all, the last closes the top.

    Args:
        wood: texture.
        size: width and depth, metres.
        heights: of the boards' upper faces, ascending, metres. The highest support comes first.
    """
    width, depth = size
    boards = [box((width, depth, BOARD), tile=0.8).moved((0.0, 0.0, z - BOARD)) for z in heights]
    bays = int(np.ceil(width / WIDEST))
    uprights = np.linspace(-(width - BOARD) / 2, (width - BOARD) / 2, bays + 1)
    sides = [box((BOARD, depth, heights[-1]), tile=0.8).moved((x, 0.0, 0.0)) for x in uprights]
    panel = box((width, 0.01, heights[-1]), tile=0.8).moved((0.0, depth / 2 - 0.005, 0.0))
    supports = [top_of(SupportKind.SHELF, (width, depth - 0.02), heights[-1])]
    for low, high in reversed(list(pairwise(heights))):
        for left, right in pairwise(uprights):
            inside = top_of(SupportKind.SHELF, (right - left - BOARD, depth - 0.02), low, high - BOARD - low, edge=0.01)
            supports.append(replace(inside, centre=(float(left + right) / 2, 0.0)))
    return Piece((Part(merged([*boards, *sides, panel]), wood, 0.1),), tuple(supports))


def wall_shelf(wood: np.ndarray, iron: np.ndarray, size: tuple[float, float], height: float, headroom: float) -> Piece:
    """A board on brackets; its back edge is at +y."""
    width, depth = size
    board = box((width, depth, BOARD), tile=0.8).moved((0.0, 0.0, height - BOARD))
    brackets = []
    for x in (-0.38 * width, 0.0, 0.38 * width):
        brackets.append(box((0.02, depth * 0.8, 0.012)).moved((x, 0.1 * depth, height - BOARD - 0.012)))
        brackets.append(box((0.02, 0.012, 0.16)).moved((x, depth / 2 - 0.006, height - BOARD - 0.16)))
    support = top_of(SupportKind.SHELF, size, height, headroom, edge=0.012)
    return Piece((Part(board, wood, 0.1), Part(merged(brackets), iron, 0.3)), (support,))


def sideboard(
    body: np.ndarray, fronts: np.ndarray, iron: np.ndarray, size: tuple[float, float, float], columns: int
) -> Piece:
    """Doors below drawers on short legs; things stand on top. Textures are of body, fronts, and handles."""
    width, depth, height = size
    legs = 0.12
    chest = box((width, depth, height - legs), tile=1.0).moved((0.0, 0.0, legs))
    ends = [(sx * (width / 2 - 0.06), sy * (depth / 2 - 0.06)) for sx in (-1, 1) for sy in (-1, 1)]
    feet = [box((0.045, 0.045, legs)).moved((x, y, 0.0)) for x, y in ends]
    pitch = (width - 0.03) / columns
    drawer = 0.17
    panels, handles = [], []
    for k in range(columns):
        x = (k - (columns - 1) / 2) * pitch
        for low, high in ((legs + 0.02, height - drawer - 0.035), (height - drawer - 0.02, height - 0.035)):
            panels.append(box((pitch - 0.015, 0.018, high - low), tile=0.8).moved((x, -depth / 2 - 0.009, low)))
            handles.append(box((0.12, 0.025, 0.014)).moved((x, -depth / 2 - 0.03, high - 0.05)))
    return Piece(
        (Part(merged([chest, *feet]), body, 0.1), Part(merged(panels), fronts, 0.1), Part(merged(handles), iron, 0.4)),
        (top_of(SupportKind.COUNTER, (width, depth), height),),
    )


def bookshelf(rng: np.random.Generator, width: float, height: float, wood: tuple[Colour, Colour]) -> Piece:
    """An open shelf, 0.3 m deep, so full of books that nothing else fits on it."""
    depth, board = 0.3, 0.022
    levels = np.linspace(0.05, height - board, 5)
    boards = [box((width, depth, board), tile=0.8).moved((0.0, 0.0, z)) for z in levels]
    sides = [box((board, depth, height), tile=0.8).moved((s * width / 2, 0.0, 0.0)) for s in (-1, 1)]
    back = box((width, 0.01, height), tile=0.8, faces="-y").moved((0.0, depth / 2 - 0.02, 0.0))
    spines, pages = [], []
    for z in levels[:-1]:
        x = -width / 2 + 0.03
        while x < width / 2 - 0.10 - 0.25 * rng.random():
            size = rng.uniform((0.02, 0.15, 0.19), (0.05, 0.22, 0.29))
            book = box(size, faces="+x-x+y+z").moved((x + size[0] / 2, -depth / 2 + size[1] / 2 + 0.02, z + board))
            front = face(size, "-y").moved((x + size[0] / 2, -depth / 2 + size[1] / 2 + 0.02, z + board))
            spines.append(_spine(front, int(rng.integers(8))))
            pages.append(book)
            x += size[0] + 0.002
    cloth = textures.plain(rng, (112, 84, 70), 0.05)
    grain = textures.wood(rng, *wood)
    return Piece(
        (
            Part(merged([*boards, *sides, back]), grain, 0.1),
            Part(merged(spines), prints.book_spines(rng)),
            Part(merged(pages), cloth),
        )
    )


def _spine(front: Mesh, column: int) -> Mesh:
    """The face showing one of the eight spines of the texture."""
    uv = front.uv * np.array([0.98 / 8, 1.0]) + np.array([(column + 0.01) / 8, 0.0])
    return Mesh(front.vertices, front.normals, uv, front.triangles)


def floor_place(x: float, y: float, width: float, depth: float) -> Piece:
    """A part of the floor on which things may stand."""
    size = (width - 2 * EDGE, depth - 2 * EDGE)
    return Piece((), (Support(SupportKind.FLOOR, (x, y), size, 0.0, 0.0),))
