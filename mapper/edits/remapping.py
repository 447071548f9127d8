"""A sequence is mapped again into the folder of a map that people had edited."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from ...datasets.errors import InputError
from ..map.map_file import DOUBTFUL_BELOW, read_map
from ..map.object_map import ObjectMap
from .edit import Target
from .identity import keep_ids, known_things
from .journal import Entry, Journal, Mapped, journal_path

WHO = "thingmap run"


def with_kept_ids(object_map: ObjectMap, map_file: Path, include_doubtful: bool) -> ObjectMap:
    """The new map, its things under the ids that they had; what is gone is noted in the journal, so that no other
    thing ever gets its id.

    Args:
        object_map: just estimated.
        map_file: of the map before, which it will replace.
        include_doubtful: whether things whose existence is below 0.5 will be in the file.
    """
    journal = Journal(journal_path(map_file))
    entries = journal.read()
    if not entries:
        return object_map
    try:
        earlier = read_map(map_file, edits=False)
    except InputError:  # gone or damaged: the journal still knows the things that were edited
        earlier = None
    known = known_things(entries, earlier)
    kept = keep_ids(object_map, known)
    ids = {thing.id for thing in kept.things if include_doubtful or thing.existence >= DOUBTFUL_BELOW}
    noted = {target.id for entry in entries if isinstance(entry, Mapped) for target in entry.gone}
    gone = tuple(target for name, target in known.items() if name not in ids and name not in noted)
    if gone:
        _note(journal, gone)
    return kept


def _note(journal: Journal, gone: tuple[Target, ...]) -> None:
    when = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")

    def make(entries: tuple[Entry, ...], number: int) -> Mapped:
        return Mapped(number, gone, WHO, when, "mapped again")

    journal.append(make)
