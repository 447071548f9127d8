"""Which edits of a journal stand, and which may be undone or done again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from .edit import Edit
from .journal import Entry, Reversal


@dataclass(frozen=True, slots=True)
class Standing:
    """The edits of a journal, as all its undos and redos leave them.

    Attributes:
        edits: those that stand, by number.
        undone: those that may be done again, the one that was undone last at the end. A new edit forgets them, as in
            every editor; in the journal they stay.
    """

    edits: tuple[Edit, ...]
    undone: tuple[Edit, ...]

    @classmethod
    def of(cls, entries: Iterable[Entry]) -> Standing:
        """Goes through a journal, the oldest entry first."""
        known: dict[int, Edit] = {}
        standing: dict[int, Edit] = {}
        undone: list[int] = []
        for entry in entries:
            if isinstance(entry, Edit):
                known[entry.number] = standing[entry.number] = entry
                undone.clear()
            elif isinstance(entry, Reversal):
                for number in entry.edits:
                    if entry.undone and standing.pop(number, None) is not None:
                        undone.append(number)
                    elif not entry.undone and number in undone:
                        undone.remove(number)
                        standing[number] = known[number]
        return cls(tuple(standing[number] for number in sorted(standing)), tuple(known[number] for number in undone))
