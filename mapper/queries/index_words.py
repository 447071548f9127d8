"""Rows of things by what they are called: id, given name, label."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from ..map.thing import Thing


class ThingWords:
    """Finds rows of things, which do not change; each table is made when it is first needed.

    Args:
        things: of a map.
    """

    def __init__(self, things: Sequence[Thing]) -> None:
        self._things = things

    def rows_named(self, name: str) -> Sequence[int]:
        """Of things with a given name; upper and lower case are the same, and so are runs of spaces."""
        return self._rows_by_name.get(_plain(name), ())

    @cached_property
    def row_of_id(self) -> dict[str, int]:
        """id -> row."""
        return {thing.id: row for row, thing in enumerate(self._things)}

    @cached_property
    def rows_by_label(self) -> dict[str, list[int]]:
        """Label in small letters -> rows of things whose posterior lists it, growing."""
        lower: dict[str, str] = {}
        found: dict[str, list[int]] = {}
        for row, thing in enumerate(self._things):
            for name in thing.class_posterior:
                key = lower.get(name) or lower.setdefault(name, name.casefold())
                rows = found.setdefault(key, [])
                if not rows or rows[-1] != row:  # "Cup" and "cup" are one label
                    rows.append(row)
        return found

    @cached_property
    def _rows_by_name(self) -> dict[str, list[int]]:
        found: dict[str, list[int]] = {}
        for row, thing in enumerate(self._things):
            if thing.name:
                found.setdefault(_plain(thing.name), []).append(row)
        return found


def _plain(name: str) -> str:
    return " ".join(name.casefold().split())
