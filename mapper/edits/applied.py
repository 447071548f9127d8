"""What edits have made of a map's ids."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..map.thing import Thing
    from .edit import Edit


@dataclass(frozen=True, slots=True)
class Pending:
    """An edit that finds its thing no more.

    Attributes:
        edit: what was said; it is kept, and done as soon as the thing is there again.
        reason: what is wrong.
    """

    edit: Edit
    reason: str

    def __str__(self) -> str:
        return f"edit {self.edit.number} waits ({self.edit}): {self.reason}"


@dataclass(frozen=True, slots=True)
class AppliedEdits:
    """Ids and edits beside the things of a map.

    Attributes:
        aliases: id of a thing that was merged into another -> the other's.
        deleted: id of a thing that was deleted -> the edit that did it.
        pending: edits that find their things no more, by number.
        parts: id of a merged thing -> the estimated things that it was made of.
        changed: whether anything is not as it was estimated.
    """

    aliases: Mapping[str, str] = field(default_factory=dict)
    deleted: Mapping[str, Edit] = field(default_factory=dict)
    pending: tuple[Pending, ...] = ()
    parts: Mapping[str, tuple[Thing, ...]] = field(default_factory=dict)
    changed: bool = False
