"""A map as it was estimated and a journal become the map that people see."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from .applied import AppliedEdits, Pending
from .edit import Action, Edit
from .effects import merged, moved, named, relabelled, resized
from .matching import mismatch
from .standing import Standing

if TYPE_CHECKING:
    from ..map.object_map import ObjectMap
    from ..map.thing import Thing
    from .journal import Entry

CHANGES = {Action.RELABEL: relabelled, Action.MOVE: moved, Action.RESIZE: resized, Action.NAME: named}


def apply_edits(object_map: ObjectMap, entries: Iterable[Entry]) -> ObjectMap:
    """The map with the edits that stand, one after the other; the map itself where none does.

    An edit is done where every thing that it is about is still there under its id, at its place and of its class
    (`matching.mismatch`). Otherwise it is left out as a whole and is among `edits.pending` with the reason.

    Args:
        object_map: as estimated.
        entries: of its journal.
    """
    standing = Standing.of(entries).edits
    if not standing:
        return object_map
    work = _Work(object_map)
    for edit in standing:
        work.apply(edit)
    return work.result()


class _Work:
    """A map on which edits are done."""

    def __init__(self, object_map: ObjectMap) -> None:
        self._map = object_map
        self._estimated = {thing.id: thing for thing in object_map.things}
        self._things = dict(self._estimated)
        before = object_map.edits
        self._aliases, self._deleted = dict(before.aliases), dict(before.deleted)
        self._parts, self._pending = dict(before.parts), list(before.pending)
        self._changed = before.changed

    def apply(self, edit: Edit) -> None:
        """Do it, or keep it with the reason why not."""
        reason = self._why_not(edit)
        if reason is not None:
            self._pending.append(Pending(edit, reason))
            return
        self._changed = True
        ids = [target.id for target in edit.targets]
        if edit.action is Action.DELETE:
            self._deleted[ids[0]] = edit
            del self._things[ids[0]]
        elif edit.action is Action.MERGE:
            self._merge(ids, edit)
        else:
            self._things[ids[0]] = CHANGES[edit.action](self._things[ids[0]], edit)

    def _why_not(self, edit: Edit) -> str | None:
        for target in edit.targets:
            reason = mismatch(target, self._estimated.get(target.id))
            if reason is None and target.id not in self._things:
                other = self._aliases.get(target.id)
                reason = f"{target.id} was merged into {other}" if other else f"{target.id} was deleted"
            if reason is not None:
                return reason
        return None

    def _merge(self, ids: list[str], edit: Edit) -> None:
        kept, *others = ids
        parts = [part for one in ids for part in self._parts.pop(one, (self._estimated[one],))]
        self._things[kept] = merged([self._things[one] for one in ids], edit)
        self._parts[kept] = tuple(parts)
        for one in others:
            del self._things[one]
        self._aliases |= dict.fromkeys(others, kept)
        self._aliases = {one: kept if other in others else other for one, other in self._aliases.items()}

    def result(self) -> ObjectMap:
        things: tuple[Thing, ...] = tuple(self._things.values())
        known = {name.casefold() for name in self._map.classes}
        new = dict.fromkeys(thing.label for thing in things if thing.label.casefold() not in known)
        edits = AppliedEdits(self._aliases, self._deleted, tuple(self._pending), self._parts, self._changed)
        return replace(self._map, things=things, classes=(*self._map.classes, *new), edits=edits)
