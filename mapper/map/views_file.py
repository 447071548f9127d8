"""`evidence.npz`: the views of every thing of a map, beside its `map.json`, which names it by fingerprint."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...datasets.errors import UserError
from ..estimation.view_log import Verdict, ViewNote
from .atomic import write_atomic
from .evidence_arrays import note_at, read_arrays, to_arrays

if TYPE_CHECKING:
    from .thing import Thing

FILE_NAME = "evidence.npz"  # beside map.json; beside NAME.json it is NAME.evidence.npz


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
        self._places: dict[str, int] = {}

    def find(self, thing_id: str) -> ThingViews | None:
        """The views of a thing, None where the file holds none of it.

        Raises:
            InputError: the file is missing, damaged or of another map.
        """
        if not self._arrays:
            self._classes, self._arrays = read_arrays(self.path, self.sha256, self.map_file)
            self._places = {name: place for place, name in enumerate(self._arrays["thing"].tolist())}
        a, place = self._arrays, self._places.get(thing_id)
        if place is None:
            return None
        rows = range(int(a["first"][place]), int(a["first"][place + 1]))
        left_out = {verdict: int(a["left_out"][place, verdict]) for verdict in Verdict}
        return ThingViews(self._classes, tuple(note_at(a, row) for row in rows), left_out)


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
    np.savez_compressed(content, **to_arrays(known, *classes or [()]))  # type: ignore[arg-type]
    write_atomic(path, content.getvalue())
    return hashlib.sha256(content.getvalue()).hexdigest() if known else None
