"""CSV: a row for every thing, for spreadsheets and data frames."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

from ..map.atomic import write_atomic
from ..map.store import OutputFolder
from ..map.thing import Thing
from .chosen import read_things

AXES = ("x", "y", "z")
COLUMNS = (
    *("id", "label", "probability", "existence", "second_label", "second_probability"),
    *AXES,
    *(f"std_{axis}" for axis in AXES),
    *(f"cov_{first}{second}" for i, first in enumerate(AXES) for second in AXES[i + 1 :]),
    *(f"size_{axis}" for axis in AXES),
    *(f"size_std_{axis}" for axis in AXES),
    *("yaw", "first_seen", "last_seen", "supporting", "occluded", "contradicting"),
    "name",
)


def export_csv(folder: OutputFolder, file: Path, *, min_existence: float = 0.0) -> int:
    """Write one row a thing under `COLUMNS`, in metres, radians and seconds; returns the number of things.

    Positions are in the map's frame, which `map.json` names; sizes are along the box's own axes, the third along up.
    `std_*` are the square roots of the position covariance's diagonal, `cov_*` its other entries in m^2. Things
    whose existence is below `min_existence` are left out.
    """
    object_map = read_things(folder, min_existence)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(_row(thing) for thing in object_map.things)
    write_atomic(file, text.getvalue().encode())
    return len(object_map)


def _row(thing: Thing) -> list[Any]:
    others = sorted(((p, label) for label, p in thing.class_posterior.items() if label != thing.label), reverse=True)
    second_probability, second_label = others[0] if others else ("", "")
    covariance = thing.position_covariance
    return [
        *(thing.id, thing.label, thing.probability, thing.existence, second_label, second_probability),
        *thing.position.tolist(),
        *thing.position_std.tolist(),
        *(float(covariance[i, j]) for i, j in ((0, 1), (0, 2), (1, 2))),
        *thing.size.tolist(),
        *thing.size_std.tolist(),
        *(thing.yaw, thing.first_seen, thing.last_seen),
        *(thing.evidence.supporting, thing.evidence.occluded, thing.evidence.contradicting),
        thing.name or "",
    ]
