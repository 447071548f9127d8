"""JSON: the same "thingmap/1" document as `map.json`, with the corners of every box worked out."""

from __future__ import annotations

from pathlib import Path

from ..map.atomic import write_atomic
from ..map.map_file import format_document, to_document
from ..map.store import OutputFolder
from .chosen import read_things


def export_json(folder: OutputFolder, file: Path, *, min_existence: float = 0.0) -> int:
    """Write the map as JSON; returns the number of things.

    To each thing of the document is added `corners`, 8 x 3 metres in map coordinates: bottom round, then top round in
    the same order. `ObjectMap.load` reads the result. Things whose existence is below `min_existence` are left out.
    """
    object_map = read_things(folder, min_existence)
    document = to_document(object_map, include_doubtful=True)  # what the folder holds was chosen when it was written
    R_world_upright = object_map.R_world_upright
    for record, thing in zip(document["things"], object_map.things, strict=True):
        record["corners"] = thing.corners(R_world_upright).tolist()
    write_atomic(file, format_document(document).encode())
    return len(object_map)
