"""`evidence.npz`: the views of every thing of a map, beside its `map.json`, which names it by fingerprint."""

from __future__ import annotations

import hashlib
import io
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from ...datasets.errors import InputError, UserError
from ...detectors.detections import Part
from ..estimation.view_log import Verdict, ViewNote
from .atomic import write_atomic

if TYPE_CHECKING:
    from .thing import Thing

SCHEMA = "thingmap-views/1"
FILE_NAME = "evidence.npz"  # beside map.json; beside NAME.json it is NAME.evidence.npz
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


@dataclass(frozen=True, slots=True, eq=False)
class ThingViews:
    """The views of one thing.

    Attributes:
        classes: K names, of the columns of every note's `log_ratio`.
        notes: those that were kept whole, by keyframe.
        left_out: how many more views said nothing, by verdict.

    Raises:
        ValueError: a note has another number of log ratios.
    """

    classes: tuple[str, ...]
    notes: tuple[ViewNote, ...]
    left_out: Mapping[Verdict, int]

    def __post_init__(self) -> None:
        for note in self.notes:
            if len(note.log_ratio) != len(self.classes):
                raise ValueError(f"log_ratio must have {len(self.classes)} values, but got {len(note.log_ratio)}")

    def read(self) -> ThingViews:
        """Itself: it is in memory."""
        return self

    def find(self) -> ThingViews:
        """Itself: it is in memory."""
        return self


@dataclass(frozen=True, slots=True)
class StoredViews:
    """The views of one thing in an evidence file, read when they are asked for."""

    file: EvidenceFile
    thing_id: str

    def read(self) -> ThingViews:
        """The views.

        Raises:
            UserError: the map names no evidence file, or that file holds nothing of this thing.
            InputError: the file is missing, damaged or of another map.
        """
        file = self.file
        if not file.sha256:
            raise UserError(
                f"{file.map_file}: the map was written without the views of its things ({file.path.name}), by which "
                "they could be explained; map again with `thingmap run`"
            )
        views = file.find(self.thing_id)
        if views is None:
            raise UserError(f"{file.path}: holds no views of {self.thing_id}; its map was not written by a run")
        return views

    def find(self) -> ThingViews | None:
        """The views, None where there is no file or it holds nothing of this thing; raises `InputError` as `read`."""
        return self.file.find(self.thing_id) if self.file.sha256 and self.file.path.exists() else None


class EvidenceFile:
    """The evidence file of one map, read once and only when it is needed.

    Args:
        path: where it should be.
        sha256: of the file as the map names it; empty where the map names none.
        map_file: the map.
    """

    def __init__(self, path: Path, sha256: str, map_file: Path) -> None:
        self.path, self.sha256, self.map_file = path, sha256, map_file
        self._arrays: dict[str, np.ndarray] = {}
        self._classes: tuple[str, ...] = ()

    def find(self, thing_id: str) -> ThingViews | None:
        """The views of a thing, None where the file holds none of it.

        Raises:
            InputError: the file is missing, damaged or of another map.
        """
        if not self._arrays:
            self._classes, self._arrays = _read(self.path, self.sha256, self.map_file)
        a = self._arrays
        places = np.flatnonzero(a["thing"] == thing_id)
        if len(places) == 0:
            return None
        place = int(places[0])
        rows = range(int(a["first"][place]), int(a["first"][place + 1]))
        left_out = {verdict: int(a["left_out"][place, verdict]) for verdict in Verdict}
        return ThingViews(self._classes, tuple(_note(a, row) for row in rows), left_out)


def evidence_path(map_file: Path) -> Path:
    """Where the evidence of a map belongs."""
    return map_file.with_name(FILE_NAME if map_file.name == "map.json" else f"{map_file.stem}.{FILE_NAME}")


def write_views(path: Path, things: Sequence[Thing]) -> str | None:
    """Writes the views of things; returns the file's SHA-256, None where nothing is known of any view.

    Then no file is made, but one that is there becomes an empty one: it is of another map.

    Raises:
        UserError: the place cannot be written, or views cannot be read from where they are now.
        ValueError: the things' views are over different classes.
    """
    known = {thing.id: views for thing in things if (views := thing.views and thing.views.find()) is not None}
    if not known and not path.exists():
        return None
    classes = {views.classes for views in known.values()}
    if len(classes) > 1:
        raise ValueError("the things of one map must have been looked for among the same classes")
    content = io.BytesIO()
    np.savez_compressed(content, **_to_arrays(known, *classes or [()]))  # type: ignore[arg-type]
    write_atomic(path, content.getvalue())
    return hashlib.sha256(content.getvalue()).hexdigest() if known else None


def _to_arrays(known: dict[str, ThingViews], classes: tuple[str, ...]) -> dict[str, np.ndarray]:
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


def _read(path: Path, sha256: str, map_file: Path) -> tuple[tuple[str, ...], dict[str, np.ndarray]]:
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


def _note(arrays: dict[str, Any], row: int) -> ViewNote:
    values = {name: arrays[name][row] for name in COLUMNS}
    plain = {name: value.item() for name, value in values.items() if value.ndim == 0}
    plain |= {"frame": str(arrays["frames"][plain["frame"]]), "verdict": Verdict(plain["verdict"])}
    return ViewNote(visible=values["visible"], log_ratio=values["log_ratio"], **plain)
