"""What is in an evidence file: one row a view, in arrays, written and read with every mistake named."""

from __future__ import annotations

import hashlib
import io
import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from ...datasets.errors import InputError
from ...detectors.detections import Part
from ..estimation.view_log import Verdict, ViewNote

if TYPE_CHECKING:
    from .views_file import ThingViews

SCHEMA = "thingmap-views/1"
REMEDY = "put the file of the same run back, or map again with `thingmap run`"
COLUMNS = {  # one row a view; `frame` counts the frames' names in `meta`
    "keyframe": np.int32,
    "stamp": np.float64,
    "frame": np.int32,
    "visible": np.float16,
    "score": np.float32,
    "part": np.int8,
    "class_id": np.int32,
    "log_ratio": np.float16,
    "weight": np.float32,
    "verdict": np.int8,
}
LARGEST = float(np.finfo(np.float16).max)


def to_arrays(known: Mapping[str, ThingViews], classes: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Arrays of the file, by name, of views by id; `classes` are those of all."""
    notes = [note for views in known.values() for note in views.notes]
    names = {name: index for index, name in enumerate(dict.fromkeys(note.frame for note in notes))}
    shapes = {"visible": (len(Part),), "log_ratio": (len(classes),)}
    arrays = {
        "meta": np.array(json.dumps({"schema": SCHEMA, "classes": classes, "frames": list(names)})),
        "thing": np.array(list(known), dtype=np.str_),
        "first": np.cumsum([0, *(len(views.notes) for views in known.values())]),
        "left_out": np.array(
            [[views.left_out.get(verdict, 0) for verdict in Verdict] for views in known.values()], dtype=np.int64
        ).reshape(-1, len(Verdict)),
    }
    for name, dtype in COLUMNS.items():
        values = [names[note.frame] if name == "frame" else getattr(note, name) for note in notes]
        column = np.array(values, dtype=np.float64).reshape(len(notes), *shapes.get(name, ()))
        arrays[name] = (np.clip(column, -LARGEST, LARGEST) if dtype is np.float16 else column).astype(dtype)
    return arrays


def read_arrays(path: Path, sha256: str, map_file: Path) -> tuple[tuple[str, ...], dict[str, np.ndarray]]:
    """Names of classes, and arrays by name.

    Args:
        path: of the file.
        sha256: of it, as the map names it.
        map_file: the map, for errors.

    Raises:
        InputError: the file is missing, damaged or of another map.
    """
    expected = f"the views of the things in {map_file.name}"
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise InputError(path, expected, "no such file", REMEDY) from None
    except OSError as error:
        raise InputError(path, expected, error.strerror or str(error), REMEDY) from None
    if hashlib.sha256(content).hexdigest() != sha256:
        raise InputError(path, expected, "a damaged file or that of another map (its SHA-256 differs)", REMEDY)
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        meta = json.loads(str(arrays.pop("meta")))
        if meta["schema"] != SCHEMA:
            raise ValueError(f"the schema {meta['schema']!r} instead of {SCHEMA!r}")
        arrays["frames"] = np.array(meta["frames"], dtype=object)
        classes = tuple(map(str, meta["classes"]))
        _check(arrays, len(classes))
    # what is no evidence fails in NumPy, zipfile, zlib or here, in many ways
    except (OSError, EOFError, ValueError, LookupError, TypeError, AttributeError, BadZipFile, zlib.error) as error:
        raise InputError(path, expected, str(error) or type(error).__name__, REMEDY) from None
    return classes, arrays


def _check(arrays: dict[str, np.ndarray], classes: int) -> None:
    first, rows = arrays["first"], len(arrays["keyframe"])
    if len(first) != len(arrays["thing"]) + 1 or first[0] != 0 or first[-1] != rows or np.any(np.diff(first) < 0):
        raise ValueError("rows that do not belong to things")
    shapes = {"visible": (rows, len(Part)), "log_ratio": (rows, classes)}
    for name, dtype in COLUMNS.items():
        column, shape = arrays[name], shapes.get(name, (rows,))
        if column.shape != shape or column.dtype != dtype:
            raise ValueError(
                f"{column.dtype} of shape {column.shape} in {name} instead of {np.dtype(dtype)} of {shape}"
            )
    limits = {"frame": (0, len(arrays["frames"])), "part": (-1, len(Part)), "class_id": (-1, classes)}
    for name, (least, end) in {**limits, "verdict": (0, len(Verdict))}.items():
        if np.any((arrays[name] < least) | (arrays[name] >= end)):
            raise ValueError(f"values in {name} outside {least}..{end - 1}")
    if arrays["left_out"].shape != (len(first) - 1, len(Verdict)):
        raise ValueError(f"left_out of shape {arrays['left_out'].shape}")
    for name in ("stamp", "visible", "log_ratio", "weight"):
        if not np.all(np.isfinite(arrays[name])):
            raise ValueError(f"numbers in {name} that are not finite")


def note_at(arrays: Mapping[str, Any], row: int) -> ViewNote:
    """The view in a row of what `read_arrays` gave."""
    values = {name: arrays[name][row] for name in COLUMNS}
    plain = {name: value.item() for name, value in values.items() if value.ndim == 0}
    plain |= {"frame": str(arrays["frames"][plain["frame"]]), "verdict": Verdict(plain["verdict"])}
    return ViewNote(visible=values["visible"], log_ratio=values["log_ratio"], **plain)
