"""`map.json`: a map written and read, with what belongs beside it."""

from __future__ import annotations

import json
from pathlib import Path

from ...datasets.errors import InputError, UserError
from .appearance import embeddings_path, write_embeddings
from .atomic import make_folder, write_atomic
from .map_from_document import CLOUD_NAME, FILE_NAME, from_document
from .map_to_document import DOUBTFUL_BELOW, SCHEMA, format_document, thing_to_dict, to_document, written_things
from .object_map import ObjectMap
from .views_file import evidence_path, write_views

__all__ = [
    "CLOUD_NAME",
    "DOUBTFUL_BELOW",
    "FILE_NAME",
    "SCHEMA",
    "format_document",
    "from_document",
    "read_map",
    "thing_to_dict",
    "to_document",
    "write_map",
]


def write_map(object_map: ObjectMap, path: Path, include_doubtful: bool = False, evidence: bool = True) -> Path:
    """Write the map to a `.json` file, or as `map.json` into a folder, made where absent; returns the file's path.

    With `evidence`, what is known of its things' views and looks goes beside it first, so that no map names what is
    not there.

    Raises:
        UserError: the place cannot be written, or the map has edits in it that the journal there holds too.
    """
    folder = path.is_dir() or path.suffix != ".json"
    file = path / FILE_NAME if folder else path
    make_folder(file.parent)
    if object_map.edits.changed and (journal := _journal_path(file)).exists():
        raise UserError(
            f"{file}: an edited map would pass for what was estimated, and {journal.name} would change it again; save "
            "it elsewhere, or load it with edits=False"
        )
    document = to_document(object_map, include_doubtful)
    if evidence:
        written, things = written_things(object_map, include_doubtful), document.pop("things")
        for name, beside, write in (
            ("evidence", evidence_path(file), write_views),
            ("embeddings", embeddings_path(file), write_embeddings),
        ):
            sha256 = write(beside, written)
            if sha256 is not None:
                document[name] = {"file": beside.name, "sha256": sha256}
        document["things"] = things
    write_atomic(file, format_document(document).encode())
    return file


def read_map(path: Path, edits: bool = True) -> ObjectMap:
    """Read a map from its file or from the folder that holds `map.json`.

    Args:
        path: where from.
        edits: do what the journal beside it says; else the map is as it was estimated.

    Raises:
        InputError: there is no such file, it is not JSON, or it is not a "thingmap/1" document; or its journal is
            damaged.
    """
    file = path / FILE_NAME if path.is_dir() else path
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(file, f"a map ({FILE_NAME})", "nothing", "give the output folder of `thingmap run`") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(file, "a readable text file", str(error), "check the file and its permissions") from None
    try:
        document = json.loads(text)
    except json.JSONDecodeError as error:
        where = f"broken JSON at line {error.lineno} ({error.msg})"
        raise InputError(file, "a map in JSON", where, "write the map again with `thingmap run`") from None
    object_map = from_document(document, file)
    return _with_edits(object_map, file) if edits and _journal_path(file).exists() else object_map


def _journal_path(file: Path) -> Path:
    from ..edits.journal import journal_path

    return journal_path(file)


def _with_edits(object_map: ObjectMap, file: Path) -> ObjectMap:
    from ..edits.apply import apply_edits
    from ..edits.journal import Journal

    return apply_edits(object_map, Journal(_journal_path(file)).read())
