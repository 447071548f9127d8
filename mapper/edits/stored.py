"""Edits in a map's own document: of a map that was saved as people had changed it, away from its journal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...datasets.json_record import JsonRecord
from .applied import AppliedEdits
from .edit import Edit

if TYPE_CHECKING:
    from ..map.thing import Thing


def thing_edits_to_dict(thing: Thing) -> dict[str, Any]:
    """Name and edits of a thing; nothing where it has none."""
    name = {} if thing.name is None else {"name": thing.name}
    return name | ({"edits": [edit.to_dict() for edit in thing.edits]} if thing.edits else {})


def thing_edits_from(record: JsonRecord) -> dict[str, Any]:
    """The inverse of `thing_edits_to_dict`, as arguments of `Thing`."""
    edits = tuple(Edit.from_record(edit) for edit in record.records("edits")) if "edits" in record else ()
    return {"name": record.name("name") if "name" in record else None, "edits": edits}


def applied_to_dict(applied: AppliedEdits) -> dict[str, Any]:
    """What became of ids; nothing where no edit was done."""
    if not applied.changed:
        return {}
    deleted = {name: edit.to_dict() for name, edit in applied.deleted.items()}
    return {"edited": {"merged_into": dict(applied.aliases), "deleted": deleted}}


def applied_from(root: JsonRecord) -> AppliedEdits:
    """The inverse of `applied_to_dict`."""
    if "edited" not in root:
        return AppliedEdits()
    record = root.record("edited")
    merged, deleted = record.record("merged_into"), record.record("deleted")
    aliases = {name: merged.name(name) for name in record.anything("merged_into")}
    gone = {name: Edit.from_record(deleted.record(name)) for name in record.anything("deleted")}
    return AppliedEdits(aliases, gone, changed=True)
