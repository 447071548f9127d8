"""Editing a map: every change is recorded beside it, and the map's own file stays as the mapper wrote it."""

from __future__ import annotations

import getpass
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import UserError
from ..map.map_file import FILE_NAME, read_map
from ..map.object_map import ObjectMap
from ..map.thing import Thing
from .applied import Pending
from .apply import apply_edits
from .defaults import MOVE_STD, RESIZE_STD, SAID_PROBABILITY
from .edit import Action, Edit, Target
from .journal import Entry, Journal, Reversal, journal_path
from .standing import Standing
from .values import stds_of, text_of, vector_of


class State(StrEnum):
    """What an entry of the journal comes to now."""

    DONE = "done"
    UNDONE = "undone"
    WAITS = "waits"  # its thing is not there, or not the same
    NOTE = ""  # undo, redo and the like: they say something about other entries


@dataclass(frozen=True, slots=True)
class HistoryLine:
    """An entry of the journal, what it comes to, and the reason where it waits."""

    entry: Entry
    state: State
    reason: str = ""


class MapEditor:
    """Changes a map on behalf of somebody. Several may edit one map at the same time, from several programs.

    Args:
        path: the output folder of a run, or its `map.json`.
        who: on whose behalf; the login name by default.

    Raises:
        InputError: there is no map.
        UserError: `who` is empty.
    """

    def __init__(self, path: str | Path, who: str | None = None) -> None:
        path = Path(path)
        self._file = path / FILE_NAME if path.is_dir() else path
        self._journal = Journal(journal_path(self._file))
        self._who = text_of("who", _login_name() if who is None else who)
        self.load()

    def load(self) -> ObjectMap:
        """The map with all edits that stand and find their things."""
        return read_map(self._file)

    def relabel(self, thing: Thing | str, label: str, *, why: str = "", probability: float = SAID_PROBABILITY) -> Edit:
        """Say what a thing is.

        Args:
            thing: of the map, or its id.
            label: any; one that the map does not know becomes one of its classes.
            why: reason, in your own words.
            probability: P(label | it exists) from then on, in [0.5, 1): nobody is certain.

        Raises:
            UserError: no such thing, or values that are not as above. The same holds for the other methods.
        """
        if not 0.5 <= probability < 1.0:
            raise UserError(f"probability {probability:g}: give one of at least 0.5 and below 1, such as 0.99")
        said = {"label": text_of("label", label), "probability": float(probability)}
        return self._edit(Action.RELABEL, [thing], why, **said)

    def delete(self, thing: Thing | str, *, why: str = "") -> Edit:
        """Say that a thing is not there. Its id stays known as that of something deleted."""
        return self._edit(Action.DELETE, [thing], why)

    def move(
        self,
        thing: Thing | str,
        position: Iterable[float],
        std: float | Iterable[float] = MOVE_STD,
        *,
        why: str = "",
    ) -> Edit:
        """Say where the centre of a thing is: (3,) metres, map frame, with std along the map's axes, metres."""
        return self._edit(Action.MOVE, [thing], why, position=vector_of("position", position), std=stds_of(std))

    def resize(
        self,
        thing: Thing | str,
        size: Iterable[float],
        std: float | Iterable[float] = RESIZE_STD,
        *,
        why: str = "",
    ) -> Edit:
        """Say how large a thing is: (3,) full extents along its box's own axes, the third the height, with their std,
        metres."""
        extents = vector_of("size", size)
        if not np.all(extents > 0.0):
            raise UserError(f"size {extents.tolist()}: give metres above 0")
        return self._edit(Action.RESIZE, [thing], why, size=extents, std=stds_of(std))

    def merge(self, things: Iterable[Thing | str], *, why: str = "") -> Edit:
        """Say that several things are one. The first keeps its id; the others' ids become other names of it."""
        return self._edit(Action.MERGE, list(things), why)

    def name(self, thing: Thing | str, name: str, *, why: str = "") -> Edit:
        """Give a thing a name of its own, such as "my mug"; an empty one takes the name away."""
        return self._edit(Action.NAME, [thing], why, name=" ".join(name.split()))

    def undo(self, n: int = 1, *, why: str = "") -> Reversal:
        """Undo the last n edits that stand; raises `UserError` where there are not so many."""
        return self._reverse(True, n, why)

    def undo_edit(self, number: int, *, why: str = "") -> Reversal:
        """Undo the edit of this number in the journal and no other; raises `UserError` where it is none that stands."""

        def make(entries: tuple[Entry, ...], own: int) -> Reversal:
            if number not in {edit.number for edit in Standing.of(entries).edits}:
                raise UserError(
                    f"{self._journal.path}: no edit {number} that stands; `thingmap edit OUT log` lists them"
                )
            return Reversal(own, True, (number,), self._who, _now(), why.strip())

        return self._journal.append(make)

    def redo(self, n: int = 1, *, why: str = "") -> Reversal:
        """Do the last n edits again that were undone, if nothing was edited since."""
        return self._reverse(False, n, why)

    def history(self) -> tuple[HistoryLine, ...]:
        """Everything that was recorded, the oldest first."""
        entries = self._journal.read()
        standing = {edit.number for edit in Standing.of(entries).edits}
        waiting = {pending.edit.number: pending.reason for pending in self.pending()}
        lines = []
        for entry in entries:
            state = State.NOTE
            if isinstance(entry, Edit):
                waits = entry.number in waiting
                state = State.UNDONE if entry.number not in standing else State.WAITS if waits else State.DONE
            lines.append(HistoryLine(entry, state, waiting.get(entry.number, "")))
        return tuple(lines)

    def pending(self) -> tuple[Pending, ...]:
        """Edits that find their things no more."""
        return self.load().edits.pending

    def _edit(self, action: Action, things: list[Thing | str], why: str, **said: Any) -> Edit:
        def make(entries: tuple[Entry, ...], number: int) -> Edit:
            estimated = read_map(self._file, edits=False)
            edited = apply_edits(estimated, entries)
            ids = list(dict.fromkeys(edited.thing(thing).id for thing in things))
            if action is Action.MERGE and len(ids) < 2:
                raise UserError("merge: give at least two things that are not one already")
            if action is Action.NAME:
                _check_free(edited, said["name"], ids[0])
            targets = tuple(Target.of(estimated.thing(one)) for one in ids)
            return Edit(number, action, targets, self._who, _now(), why.strip(), **said)

        return self._journal.append(make)

    def _reverse(self, undone: bool, n: int, why: str) -> Reversal:
        def make(entries: tuple[Entry, ...], number: int) -> Reversal:
            standing = Standing.of(entries)
            candidates, verb = (standing.edits, "undo") if undone else (standing.undone, "redo")
            if not 1 <= n <= len(candidates):
                raise UserError(f"{self._journal.path}: {len(candidates)} edits to {verb}, but asked for {n}")
            numbers = tuple(edit.number for edit in reversed(candidates[-n:]))
            return Reversal(number, undone, numbers, self._who, _now(), why.strip())

        return self._journal.append(make)


def _check_free(object_map: ObjectMap, name: str, own: str) -> None:
    """A name is that of one thing."""
    others = (thing for thing in object_map.things if thing.id != own and thing.name)
    other = next((thing for thing in others if str(thing.name).casefold() == name.casefold()), None)
    if other is not None:
        raise UserError(f"name {name!r}: {other.id} has it already; choose another one, or take it away there first")


def _login_name() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return "unknown"


def _now() -> str:
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
