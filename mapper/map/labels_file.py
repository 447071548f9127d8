"""The labelled cloud, labels.ply: what each point is, whose it is, and how sure its label is."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import InputError
from ...datasets.truth import NO_OBJECT
from .cloud_file import coloured_vertices, read_vertices, write_vertices

A_CLOUD = "a labelled cloud in PLY"
LABEL_AGAIN = "write it again with `thingmap label`"
REMOVE = "write it again, or remove it"


@dataclass(frozen=True, slots=True, eq=False)
class PointLabels:
    """What M points are.

    Attributes:
        label: (M,) int64 index into the map's classes, `NO_OBJECT` for background.
        second: (M,) the same: what a point's own evidence says next to its label, or rather than that.
        margin: (M,) float32 nats of one look, by which a point's own evidence is for `label` and not for `second`;
            below 0 where its neighbours have decided. Both are None where nobody knows.
        instance: (M,) number of each point's thing, 0 for none; None where nobody knows.

    Raises:
        ValueError: only one of second and margin is there, or the arrays are of different lengths.
    """

    label: np.ndarray
    second: np.ndarray | None = None
    margin: np.ndarray | None = None
    instance: np.ndarray | None = None

    def __post_init__(self) -> None:
        arrays = self.label, self.second, self.margin, self.instance
        lengths = {len(array) for array in arrays if array is not None}
        if (self.second is None) != (self.margin is None) or len(lengths) > 1:
            raise ValueError("label, instance, and either second and margin or neither, must be of equal lengths")


def write_labels(
    file: Path,
    points: np.ndarray,
    colors: np.ndarray,
    labels: PointLabels,
    classes: Sequence[str],
    things: Sequence[str] = (),
) -> None:
    """A cloud with a class for every point, and the thing that it belongs to where that is known.

    Args:
        file: to write.
        points: (M, 3) metres, map frame.
        colors: (M, 3) uint8 RGB.
        labels: of the points. In the file labels and seconds are 0 for none and k + 1 for class k, which a comment line
            names: `comment label 3 "cup"`. What nobody knows, the file has no property for.
        classes: of the map.
        things: ids of those that instances are numbers of, from 1 on (`comment instance 1 "thing-0007"`).
    """
    values, comments = {"label": _numbers(labels.label)}, _numbered("label", classes)
    if labels.instance is not None:
        values["instance"] = labels.instance
        comments += _numbered("instance", things)
    if labels.second is not None and labels.margin is not None:
        values |= {"second": _numbers(labels.second), "margin": labels.margin}
    kinds = [(name, "<f4" if name == "margin" else "<i4") for name in values]
    vertices = coloured_vertices(points, colors, *kinds)
    for name, numbers in values.items():
        vertices[name] = numbers
    write_vertices(file, vertices, comments)


def read_labels(file: Path, classes: Sequence[str]) -> tuple[np.ndarray, PointLabels]:
    """(M, 3) metres, and the labels of these points for a map's classes.

    Any program may have written the file: a cloud whose vertices have an integer `label` (or `class`). Comment lines
    `label 3 "cup"` say what a number means; what they do not name is nothing. Without them it is an index into
    `classes`, negative for nothing.

    Raises:
        InputError: the file is damaged, or its labels are not of these classes.
    """
    points, vertices, comments = read_vertices(file, A_CLOUD, REMOVE)
    fields = vertices.dtype.names or ()
    field = next((name for name in ("label", "class") if name in fields), None)
    if field is None:
        found = "no such property"
        raise InputError(file, "an integer `label` for every vertex", found, "add it, or remove the file")
    named = _named_labels(file, comments, classes)
    label = _labels_of(file, vertices, field, named, classes)
    instance = vertices["instance"].astype(np.int64) if "instance" in fields else None
    if not {"second", "margin"} <= set(fields):
        return points, PointLabels(label, instance=instance)
    second = _labels_of(file, vertices, "second", named, classes)
    return points, PointLabels(label, second, vertices["margin"].astype(np.float32), instance)


def read_instances(file: Path) -> dict[str, np.ndarray]:
    """Id of each thing that the labelled cloud names -> its points, (M, 3) float64 metres, read-only.

    Raises:
        InputError: the file is absent or damaged, or says of no point whose it is.
    """
    points, vertices, comments = read_vertices(file, A_CLOUD, LABEL_AGAIN)
    if "instance" not in (vertices.dtype.names or ()):
        raise InputError(file, "an `instance` for every vertex", "no such property", LABEL_AGAIN)
    number = vertices["instance"].astype(np.int64)
    try:
        lines = [line.split(maxsplit=2) for line in comments]
        named = [(int(words[1]), str(json.loads(words[2]))) for words in lines if words[:1] == ["instance"]]
    except (LookupError, ValueError) as error:
        raise InputError(file, A_CLOUD, str(error), LABEL_AGAIN) from None
    order = np.argsort(number, kind="stable")
    ordered = number[order]
    ends = ((thing, *(np.searchsorted(ordered, n, side) for side in ("left", "right"))) for n, thing in named)
    own = {thing: points[order[first:last]] for thing, first, last in ends}
    for array in own.values():
        array.setflags(write=False)
    return own


def _labels_of(
    file: Path, vertices: np.ndarray, field: str, named: dict[int, int], classes: Sequence[str]
) -> np.ndarray:
    """(M,) int64 indices into `classes`, `NO_OBJECT` for none, from the numbers of a property."""
    numbers = vertices[field]
    if numbers.dtype.kind not in "iu":
        raise InputError(file, f"an integer `{field}`", f"type {numbers.dtype}", "write it as int, or remove the file")
    numbers = numbers.astype(np.int64)
    if named:
        codes, inverse = np.unique(numbers, return_inverse=True)
        return np.array([named.get(int(code), NO_OBJECT) for code in codes], dtype=np.int64)[inverse]
    if len(numbers) and numbers.max() >= len(classes):
        expected = f"`{field}` below {len(classes)}, the number of the map's classes"
        remedy = 'say what the labels mean in comment lines such as `label 3 "cup"`'
        raise InputError(file, expected, str(numbers.max()), remedy)
    return np.where(numbers < 0, NO_OBJECT, numbers)


def _named_labels(file: Path, comments: Sequence[str], classes: Sequence[str]) -> dict[int, int]:
    """Number in the file -> index into the classes, from comment lines `label 3 "cup"`."""
    index = {name.casefold(): k for k, name in enumerate(classes)}
    named: dict[int, int] = {}
    for line in comments:
        words = line.split(maxsplit=2)
        if len(words) != 3 or words[0] != "label":
            continue
        try:
            number, name = int(words[1]), _text(json.loads(words[2]))
        except ValueError:
            remedy = 'write lines such as `comment label 3 "cup"`'
            raise InputError(file, "a number and a name in quotes", repr(line), remedy) from None
        if name.casefold() not in index:
            known = ", ".join(classes)
            raise InputError(
                file, f"classes of the map ({known})", repr(name), "label the cloud with the map's classes"
            )
        named[number] = index[name.casefold()]
    return named


def _numbers(label: np.ndarray) -> np.ndarray:
    return np.where(label == NO_OBJECT, 0, label + 1)


def _numbered(what: str, names: Sequence[str]) -> list[str]:
    """Comment lines that say what the numbers from 1 on mean."""
    return [f"{what} {number} {json.dumps(name)}" for number, name in enumerate(names, start=1)]


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{value!r} is no text")
    return value
