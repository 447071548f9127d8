"""Coloured clouds as binary PLY."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...datasets.errors import InputError
from .atomic import replacing

AGAIN = "write it again with `thingmap run`"
COLOR_FIELDS = (("red", "u1"), ("green", "u1"), ("blue", "u1"))


def write_cloud(file: Path, points: np.ndarray, colors: np.ndarray) -> None:
    """(M, 3) metres and (M, 3) uint8 RGB."""
    write_vertices(file, coloured_vertices(points, colors), [])


def read_cloud(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """(M, 3) float64 metres and (M, 3) uint8 RGB.

    Raises:
        InputError: the file is absent or damaged.
    """
    names = [name for name, _ in COLOR_FIELDS]
    points, vertices, _ = read_vertices(file, "a coloured cloud in PLY", AGAIN, needed=names)
    return points, np.stack([vertices[name] for name in names], axis=1)


def read_vertices(
    file: Path, expected: str, remedy: str, needed: Sequence[str] = ()
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """(M, 3) float64 points of a PLY, (M,) records with all properties of its vertices, and its comment lines.

    Raises:
        InputError: the file is absent or damaged, or a property is missing, which `expected` and `remedy` are said of.
    """
    from plyfile import PlyData, PlyParseError

    try:
        content = PlyData.read(str(file))
        vertices = content["vertex"].data
        points = np.stack([vertices[axis] for axis in "xyz"], axis=1).astype(np.float64)
    except (OSError, KeyError, ValueError, PlyParseError) as error:
        raise InputError(file, expected, str(error), remedy) from None
    missing = [name for name in needed if name not in (vertices.dtype.names or ())]
    if missing:
        raise InputError(file, expected, f"vertices without {', '.join(missing)}", remedy)
    return points, vertices, [*content.comments, *content["vertex"].comments]


def coloured_vertices(points: np.ndarray, colors: np.ndarray, *more: tuple[str, str]) -> np.ndarray:
    """(M,) records of (M, 3) points and (M, 3) colours, with more fields that are still empty."""
    vertices = np.empty(len(points), dtype=[*((axis, "<f4") for axis in "xyz"), *COLOR_FIELDS, *more])
    for column, axis in enumerate("xyz"):
        vertices[axis] = points[:, column]
    for column, (name, _) in enumerate(COLOR_FIELDS):
        vertices[name] = colors[:, column]
    return vertices


def write_vertices(file: Path, vertices: np.ndarray, comments: list[str]) -> None:
    """A cloud of such records, with comment lines in its head."""
    from plyfile import PlyData, PlyElement

    with replacing(file) as temporary:
        elements = [PlyElement.describe(vertices, "vertex")]
        PlyData(elements, byte_order="<", comments=comments).write(str(temporary))
