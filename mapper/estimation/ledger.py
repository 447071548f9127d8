"""The append-only list of measurements from which the graph can be rebuilt.

It is the saved session, the journal and the crash recovery in one: GTSAM's custom factors and ISAM2 do not serialise,
measurements do.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from ...datasets.errors import InputError
from .records import KINDS, Record

SCHEMA = "thingmap-ledger/4"
# 1 knew no parts: what has a default since is filled with it; 2 knew no loop closures; 3 took no measurement back
_READABLE = ("thingmap-ledger/1", "thingmap-ledger/2", "thingmap-ledger/3", SCHEMA)


class Ledger:
    """Records in the order in which they were made."""

    def __init__(self) -> None:
        self._records: list[Record] = []

    def append(self, record: Record) -> int:
        """Adds a record; returns its number."""
        self._records.append(record)
        return len(self._records) - 1

    def __len__(self) -> int:
        return len(self._records)

    def __getitem__(self, index: int) -> Record:
        return self._records[index]

    def __iter__(self) -> Iterator[Record]:
        return iter(self._records)

    def save(self, path: Path, meta: dict | None = None) -> None:
        """Writes one array per kind and field (`.npz`), with the records' numbers, and `meta` as JSON."""
        arrays: dict[str, np.ndarray] = {"meta": np.array(json.dumps({"schema": SCHEMA, **(meta or {})}))}
        for kind in KINDS:
            numbered = [(i, r) for i, r in enumerate(self._records) if type(r) is kind]
            if not numbered:
                continue
            arrays[f"{kind.__name__}/number"] = np.array([i for i, _ in numbered])
            for f in fields(kind):
                arrays[f"{kind.__name__}/{f.name}"] = np.stack([np.asarray(getattr(r, f.name)) for _, r in numbered])
        with path.open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: Path) -> tuple[Ledger, dict]:
        """The ledger and its `meta`.

        Raises:
            InputError: where the file is not a ledger.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            meta = json.loads(str(arrays.pop("meta")))
            if meta["schema"] not in _READABLE:
                raise ValueError(f"schema {meta['schema']!r} instead of {SCHEMA!r}")
            records = _records(arrays)
        # a damaged archive fails in NumPy, zipfile, zlib or here, in many ways
        except (OSError, EOFError, ValueError, LookupError, TypeError, AttributeError, BadZipFile, zlib.error) as error:
            found = str(error) or type(error).__name__
            raise InputError(path, "a ledger (.npz)", found, "give the ledger.npz of a run, or map again") from None
        ledger = cls()
        ledger._records = records
        return ledger, meta


def _records(arrays: dict[str, np.ndarray]) -> list[Record]:
    """Records from one array per kind and field, in the order of their numbers."""
    numbered: list[tuple[int, Record]] = []
    for kind in KINDS:
        numbers = arrays.get(f"{kind.__name__}/number", np.empty(0, dtype=int))
        written = [f for f in fields(kind) if len(numbers) and not _is_left_out(arrays, kind, f)]
        columns = [_column(arrays[f"{kind.__name__}/{f.name}"], f.type) for f in written]
        for number, *row in zip(numbers, *columns, strict=True):
            numbered.append((int(number), kind(**{f.name: v for f, v in zip(written, row, strict=True)})))
    return [record for _, record in sorted(numbered, key=lambda item: item[0])]


def _is_left_out(arrays: dict[str, np.ndarray], kind: type, column: Field) -> bool:
    """Whether a column that was added later, and has a default since, is not in the file."""
    has_default = column.default is not MISSING or column.default_factory is not MISSING
    return has_default and f"{kind.__name__}/{column.name}" not in arrays


def _column(values: np.ndarray, kind: object) -> list:
    """Rows as arrays, or as plain numbers where the field is one."""
    return list(values) if kind == "np.ndarray" else values.tolist()
