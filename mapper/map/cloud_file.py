"""Coloured and labelled clouds as binary PLY."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...datasets.errors import InputError
from ...datasets.truth import NO_OBJECT
from .atomic import replacing

AGAIN = "write it again with `thingmap run`"
LABEL_AGAIN = "write it again with `thingmap label`"
COLOR_FIELDS = (("red", "u1"), ("green", "u1"), ("blue", "u1"))


def write_cloud(file: Path, points: np.ndarray, colors: np.ndarray) -> None:
    """(M, 3) metres and (M, 3) uint8 RGB."""
    _write_vertices(file, _vertices(points, colors), [])


def write_labels(
    file: Path,
    points: np.ndarray,
    colors: np.ndarray,
    labels: np.ndarray,
    classes: Sequence[str],
    instance: np.ndarray | None = None,
    things: Sequence[str] = (),
) -> None:
    """A cloud with a class for every point, and the thing that it belongs to where that is known.

    Args:
        file: to write.
        points: (M, 3) metres, map frame.
        colors: (M, 3) uint8 RGB.
        labels: (M,) indices into `classes`, `NO_OBJECT` for none. In the file they are 0 for none and k + 1 for
            class k, which a comment line names: `comment label 3 "cup"`.
        classes: of the map.
        instance: (M,) number of each point's thing, t + 1 for `things[t]` (`comment instance 1 "thing-0007"`) and 0 for
            none; None where nobody knows: the file has no such property then.
        things: their ids.
    """
    more = [("label", "<i4")] if instance is None else [("label", "<i4"), ("instance", "<i4")]
    vertices = _vertices(points, colors, *more)
    vertices["label"] = np.where(labels == NO_OBJECT, 0, labels + 1)
    comments = _numbered("label", classes)
    if instance is not None:
        vertices["instance"] = instance
        comments += _numbered("instance", things)
    _write_vertices(file, vertices, comments)


def read_cloud(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """(M, 3) float64 metres and (M, 3) uint8 RGB.

    Raises:
        InputError: the file is absent or damaged.
    """
    from plyfile import PlyData, PlyParseError

    try:
        vertices = PlyData.read(str(file))["vertex"].data
        points = np.stack([vertices[axis] for axis in "xyz"], axis=1).astype(np.float64)
        return points, np.stack([vertices[name] for name, _ in COLOR_FIELDS], axis=1)
    except (OSError, KeyError, ValueError, PlyParseError) as error:
        raise InputError(file, "a coloured cloud in PLY", str(error), AGAIN) from None


def read_instances(file: Path) -> dict[str, np.ndarray]:
    """Id of each thing that the labelled cloud names -> its points, (M, 3) float64 metres, read-only.

    Raises:
        InputError: the file is absent or damaged, or says of no point whose it is.
    """
    from plyfile import PlyData, PlyParseError

    try:
        content = PlyData.read(str(file))
        vertices = content["vertex"].data
        if "instance" not in (vertices.dtype.names or ()):
            raise InputError(file, "an `instance` for every vertex", "no such property", LABEL_AGAIN)
        points = np.stack([vertices[axis] for axis in "xyz"], axis=1).astype(np.float64)
        number = vertices["instance"].astype(np.int64)
        lines = [line.split(maxsplit=2) for line in content.comments]
        named = [(int(words[1]), str(json.loads(words[2]))) for words in lines if words[0] == "instance"]
    except (OSError, LookupError, ValueError, PlyParseError) as error:
        raise InputError(file, "a labelled cloud in PLY", str(error), LABEL_AGAIN) from None
    order = np.argsort(number, kind="stable")
    ordered = number[order]
    ends = ((thing, *(np.searchsorted(ordered, n, side) for side in ("left", "right"))) for n, thing in named)
    own = {thing: points[order[first:last]] for thing, first, last in ends}
    for array in own.values():
        array.setflags(write=False)
    return own


def _numbered(what: str, names: Sequence[str]) -> list[str]:
    """Comment lines that say what the numbers from 1 on mean."""
    return [f"{what} {number} {json.dumps(name)}" for number, name in enumerate(names, start=1)]


def _vertices(points: np.ndarray, colors: np.ndarray, *more: tuple[str, str]) -> np.ndarray:
    """(M,) records of (M, 3) points and (M, 3) colours, with more fields that are still empty."""
    vertices = np.empty(len(points), dtype=[*((axis, "<f4") for axis in "xyz"), *COLOR_FIELDS, *more])
    for column, axis in enumerate("xyz"):
        vertices[axis] = points[:, column]
    for column, (name, _) in enumerate(COLOR_FIELDS):
        vertices[name] = colors[:, column]
    return vertices


def _write_vertices(file: Path, vertices: np.ndarray, comments: list[str]) -> None:
    from plyfile import PlyData, PlyElement

    with replacing(file) as temporary:
        elements = [PlyElement.describe(vertices, "vertex")]
        PlyData(elements, byte_order="<", comments=comments).write(str(temporary))
