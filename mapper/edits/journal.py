"""`edits.jsonl`: the journal of a map's edits, one JSON object a line; lines are added and never changed."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

from ...datasets.errors import InputError, UserError
from ...datasets.json_record import JsonRecord
from .edit import Action, Edit, Target

SCHEMA = "thingmap-edits/1"
FILE_NAME = "edits.jsonl"  # beside map.json; beside NAME.json it is NAME.edits.jsonl
REMEDY = "put the journal back as `thingmap edit` wrote it"
UNDO, REDO, MAPPED = "undo", "redo", "mapped"  # actions of the lines that are no edits


@dataclass(frozen=True, slots=True)
class Reversal:
    """Edits that are undone, or done again.

    Attributes:
        number: in the journal.
        undone: whether they are undone; else they are done again.
        edits: their numbers.
        who, when, why: as for `Edit`.
    """

    number: int
    undone: bool
    edits: tuple[int, ...]
    who: str
    when: str
    why: str = ""

    def __str__(self) -> str:
        return f"{UNDO if self.undone else REDO} of {', '.join(map(str, self.edits))}"

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        action = UNDO if self.undone else REDO
        about = {"who": self.who, "when": self.when, "why": self.why}
        return {"number": self.number, "action": action, **about, "edits": list(self.edits)}


@dataclass(frozen=True, slots=True)
class Mapped:
    """The sequence was mapped again, and these things are not there any more; their ids are theirs for ever.

    Attributes:
        number: in the journal.
        gone: the things, as they had been estimated.
        who, when, why: as for `Edit`.
    """

    number: int
    gone: tuple[Target, ...]
    who: str
    when: str
    why: str = ""

    def __str__(self) -> str:
        return f"mapped again; gone: {', '.join(target.id for target in self.gone) or 'nothing'}"

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        about = {"who": self.who, "when": self.when, "why": self.why}
        return {"number": self.number, "action": MAPPED, **about, "gone": [target.to_dict() for target in self.gone]}


Entry = Edit | Reversal | Mapped
Made = TypeVar("Made", Edit, Reversal, Mapped)


def journal_path(map_file: Path) -> Path:
    """Where the journal of a map belongs."""
    return map_file.with_name(FILE_NAME if map_file.name == "map.json" else f"{map_file.stem}.{FILE_NAME}")


class Journal:
    """The journal of one map.

    Args:
        path: of the file; where there is none, nothing was edited.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> tuple[Entry, ...]:
        """All entries, the oldest first.

        Raises:
            InputError: the file cannot be read, or a line is no entry; it says which.
        """
        try:
            content = self.path.read_bytes()
        except FileNotFoundError:
            return ()
        except OSError as error:
            raise InputError(self.path, "a journal of edits", error.strerror or str(error), REMEDY) from None
        return self._parse(content)

    def append(self, make: Callable[[tuple[Entry, ...], int], Made]) -> Made:
        """Add one entry; nobody else writes meanwhile.

        Args:
            make: from the entries that are there and the new one's number, the entry; what it raises is passed on,
                and nothing is written.

        Raises:
            InputError: the journal is damaged.
            UserError: it cannot be written.
        """
        with self._locked() as file:
            content = _read_all(file)
            entries = self._parse(content)
            entry = make(entries, 1 + max((one.number for one in entries), default=0))
            line = json.dumps({"schema": SCHEMA, **entry.to_dict()}, ensure_ascii=False, allow_nan=False)
            try:
                # a line that a power cut left half written never was an entry
                os.ftruncate(file, content.rfind(b"\n") + 1)
                os.lseek(file, 0, os.SEEK_END)
                _write_all(file, line.encode() + b"\n")
                os.fsync(file)
            except OSError as error:
                raise self._unwritable(error) from error
        return entry

    @contextmanager
    def _locked(self) -> Iterator[int]:
        """The file, open and locked until the block ends; others wait."""
        try:
            file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise self._unwritable(error) from error
        try:
            try:
                import fcntl
            except ImportError:  # Windows: two people who edit one map in the same second may disturb each other
                yield file
                return
            fcntl.flock(file, fcntl.LOCK_EX)
            yield file
        finally:
            os.close(file)  # the lock goes with it

    def _parse(self, content: bytes) -> tuple[Entry, ...]:
        lines = content.split(b"\n")[:-1]  # behind the last line's end there is nothing, or half a line
        entries = tuple(self._entry(line, number) for number, line in enumerate(lines, start=1) if line.strip())
        numbers = [entry.number for entry in entries]
        if any(later <= earlier for earlier, later in pairwise(numbers)):
            raise InputError(self.path, "entries whose numbers grow", f"{numbers}"[:60], REMEDY)
        return entries

    def _entry(self, line: bytes, number: int) -> Entry:
        try:
            value = json.loads(line)
        except ValueError as error:  # of JSON or of UTF-8
            raise InputError(self.path, f"JSON in line {number}", str(error), REMEDY) from None
        record = JsonRecord(value, self.path, REMEDY, f"line {number}")
        if record.text("schema") != SCHEMA:
            remedy = "open it with the version of thingmap that wrote it"
            raise InputError(self.path, f'the schema "{SCHEMA}"', repr(record.text("schema")), remedy)
        action = record.choice("action", (*Action, UNDO, REDO, MAPPED))
        about = {"number": record.count("number"), **{name: record.text(name) for name in ("who", "when", "why")}}
        if action in (UNDO, REDO):
            edits = record.anything("edits")
            with record.explaining():
                if not isinstance(edits, list) or not edits or not all(type(one) is int for one in edits):
                    raise ValueError(f"edits must be numbers, but got {edits!r}")
            return Reversal(undone=action == UNDO, edits=tuple(edits), **about)
        if action == MAPPED:
            return Mapped(gone=tuple(Target.from_record(target) for target in record.records("gone")), **about)
        return Edit.from_record(record)

    def _unwritable(self, error: OSError) -> UserError:
        reason = error.strerror or str(error)
        return UserError(f"{self.path}: cannot be written ({reason}); edit a map in a folder that you may write to")


def _read_all(file: int) -> bytes:
    os.lseek(file, 0, os.SEEK_SET)
    parts = []
    while part := os.read(file, 1 << 20):
        parts.append(part)
    return b"".join(parts)


def _write_all(file: int, content: bytes) -> None:
    while content:
        content = content[os.write(file, content) :]
