"""How things look: the detector's embeddings, averaged, in `embeddings.npz` beside the map, which names it."""

from __future__ import annotations

import hashlib
import io
import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol
from zipfile import BadZipFile

import numpy as np

from ...datasets.errors import InputError
from .atomic import write_atomic

if TYPE_CHECKING:
    from .thing import Thing

SCHEMA = "thingmap-embeddings/1"
FILE_NAME = "embeddings.npz"  # beside map.json; beside NAME.json it is NAME.embeddings.npz
REMEDY = "put the file of the same run back, or map again with `thingmap run`"


class SomeAppearance(Protocol):
    """An appearance, wherever it is."""

    def read(self) -> Appearance | None:
        """The appearance, None where nobody knows how the thing looks."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Appearance:
    """How one thing looks.

    Attributes:
        embedding: (D,) float32 of length 1, read-only: mean of the detector's embeddings, each of length 1 before,
            weighted as their scores are.
        views: how many keyframes it is the mean of.

    Raises:
        ValueError: it has no direction, or no view.
    """

    embedding: np.ndarray
    views: int

    def __post_init__(self) -> None:
        embedding = np.array(self.embedding, dtype=np.float32)
        length = float(np.linalg.norm(embedding))
        if embedding.ndim != 1 or not np.isfinite(length) or length == 0.0:
            raise ValueError(f"embedding must be (D,) numbers that are not all 0, but got shape {embedding.shape}")
        if self.views < 1:
            raise ValueError(f"views must be at least 1, but got {self.views}")
        if abs(length - 1.0) > 1e-6:  # else what is read would not be what was written
            embedding /= length
        embedding.setflags(write=False)
        object.__setattr__(self, "embedding", embedding)

    @classmethod
    def mean(cls, known: Sequence[Appearance]) -> Appearance | None:
        """Over the views of all; None of nothing, of embeddings of several detectors, or where they cancel out."""
        if not known or len({len(one.embedding) for one in known}) > 1:
            return None
        total = np.sum([one.views * one.embedding.astype(np.float64) for one in known], axis=0)
        length = np.linalg.norm(total)
        return cls(total / length, sum(one.views for one in known)) if length > 1e-9 else None

    def read(self) -> Appearance:
        """Itself: it is in memory."""
        return self


@dataclass(frozen=True, slots=True)
class StoredAppearance:
    """How one thing looks, in the map's file of embeddings, read when it is asked for."""

    file: EmbeddingFile
    thing_id: str

    def read(self) -> Appearance | None:
        """The appearance, None where the file holds none of this thing.

        Raises:
            InputError: the file is missing, damaged or of another map.
        """
        return self.file.find(self.thing_id)


class EmbeddingFile:
    """The embeddings of one map, read once and only when they are needed.

    Args:
        path: where they should be.
        sha256: of the file as the map names it.
        map_file: the map.
    """

    def __init__(self, path: Path, sha256: str, map_file: Path) -> None:
        self.path, self.sha256, self.map_file = path, sha256, map_file
        self._rows: dict[str, int] | None = None
        self._embedding, self._views = np.empty((0, 0), dtype=np.float32), np.empty(0, dtype=np.int64)

    def find(self, thing_id: str) -> Appearance | None:
        """How a thing looks, None where nobody knows; raises as `StoredAppearance.read`."""
        if self._rows is None:
            ids, self._embedding, self._views = _read(self.path, self.sha256, self.map_file)
            self._rows = {name: row for row, name in enumerate(ids)}
        row = self._rows.get(thing_id)
        return None if row is None else Appearance(self._embedding[row], int(self._views[row]))


def embeddings_path(map_file: Path) -> Path:
    """Where the embeddings of a map belong."""
    return map_file.with_name(FILE_NAME if map_file.name == "map.json" else f"{map_file.stem}.{FILE_NAME}")


def write_embeddings(path: Path, things: Sequence[Thing]) -> str | None:
    """Write how things look; returns the file's SHA-256, None where nobody knows of any: then no file is made.

    Raises:
        UserError: the place cannot be written, or embeddings cannot be read from where they are now.
        ValueError: embeddings of different length.
    """
    found = {thing.id: thing.appearance.read() for thing in things if thing.appearance is not None}
    known = {name: one for name, one in found.items() if one is not None}
    if not known:
        return None
    if len({len(one.embedding) for one in known.values()}) > 1:
        raise ValueError("the embeddings of one map must have one length")
    content = io.BytesIO()
    np.savez(
        content,
        meta=np.array(json.dumps({"schema": SCHEMA})),
        thing=np.array(list(known), dtype=np.str_),
        embedding=np.stack([one.embedding for one in known.values()]),
        views=np.array([one.views for one in known.values()], dtype=np.int64),
    )
    write_atomic(path, content.getvalue())
    return hashlib.sha256(content.getvalue()).hexdigest()


def _read(path: Path, sha256: str, map_file: Path) -> tuple[list[str], np.ndarray, np.ndarray]:
    expected = f"the embeddings of the things in {map_file.name}"
    try:
        content = path.read_bytes()
    except OSError as error:
        found = "no such file" if isinstance(error, FileNotFoundError) else error.strerror or str(error)
        raise InputError(path, expected, found, REMEDY) from None
    if hashlib.sha256(content).hexdigest() != sha256:
        raise InputError(path, expected, "a damaged file or that of another map (its SHA-256 differs)", REMEDY)
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            meta, things = json.loads(str(file["meta"])), file["thing"]
            embedding, views = file["embedding"], file["views"]
        if meta["schema"] != SCHEMA:
            raise ValueError(f"the schema {meta['schema']!r} instead of {SCHEMA!r}")
        if embedding.ndim != 2 or embedding.dtype != np.float32 or not np.isfinite(embedding).all():
            raise ValueError(f"{embedding.dtype} embeddings of shape {embedding.shape}, or not finite ones")
        if things.shape != embedding.shape[:1] or views.shape != things.shape or views.dtype.kind != "i":
            raise ValueError("rows that do not belong to things")
        if np.any(views < 1) or not np.all(np.any(embedding != 0.0, axis=1)):
            raise ValueError("a thing without a view, or an embedding of zeros")
    # what is no file of embeddings fails in NumPy, zipfile, zlib or here, in many ways
    except (OSError, EOFError, ValueError, LookupError, TypeError, AttributeError, BadZipFile, zlib.error) as error:
        raise InputError(path, expected, str(error) or type(error).__name__, REMEDY) from None
    return things.tolist(), embedding, views
