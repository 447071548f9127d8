"""Parquet: tables with nested columns, for data frames, DuckDB and fleets of maps.

    things      a row a thing: what map.json says of it, the corners of its box too
    views       a row for what one keyframe said of one thing: verdict, score, visible shares, log ratios
    trajectory  a row for each mapped frame: stamp, position, quaternion, whether it is a keyframe

Metres, radians, seconds; positions are in the map's frame. The file's key-value metadata name the frame, the source and
which way is up. Needs pyarrow (`pip install "thingmap[parquet]"`).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import UserError
from ..estimation.view_log import ViewNote
from ..map.atomic import replacing
from ..map.explanation import PART_NAMES, REASONS
from ..map.map_file import thing_to_dict
from ..map.object_map import ObjectMap
from ..map.store import OutputFolder
from .chosen import read_things
from .optional import optional_module
from .rotations import quaternions
from .trajectory_files import read_poses

SCHEMA = "thingmap-table/1"
TABLES = ("things", "views", "trajectory")
ROUNDING = 1e-5  # s; files of trajectories hold microseconds


def export_parquet(folder: OutputFolder, file: Path, *, table: str = "things", min_existence: float = 0.0) -> int:
    """Write one of `TABLES`; returns the number of rows.

    Args:
        folder: of the run.
        file: to write.
        table: which.
        min_existence: things below it, and their views, are left out.

    Raises:
        UserError: pyarrow is not installed, there is no such table, or there are no views on record.
        InputError: a file of the run is absent or damaged.
    """
    arrow = optional_module("pyarrow", "pyarrow", "parquet")
    parquet = optional_module("pyarrow.parquet", "pyarrow", "parquet")
    if table not in TABLES:
        raise UserError(f"table {table!r}: there are {', '.join(TABLES)}; choose one of them")
    object_map = read_things(folder, min_existence)
    if table == "things":
        fields, rows = _thing_fields(arrow), _thing_rows(object_map)
    elif table == "views":
        fields, rows = _view_fields(arrow), _view_rows(object_map)
    else:
        fields, rows = _pose_fields(arrow), _pose_rows(folder)
    schema = arrow.schema(fields, metadata=_about(object_map, table))
    with replacing(file) as temporary:
        parquet.write_table(arrow.Table.from_pylist(rows, schema=schema), str(temporary))
    return len(rows)


def _about(object_map: ObjectMap, table: str) -> dict[str, str]:
    return {
        "thingmap.schema": SCHEMA,
        "thingmap.table": table,
        "thingmap.source": object_map.source,
        "thingmap.frame": str(object_map.frame),
        "thingmap.up": json.dumps(object_map.up.direction.tolist()),
        "thingmap.units": "metres, radians, seconds",
    }


def _thing_fields(arrow: Any) -> list[Any]:
    number, vector = arrow.float64(), arrow.list_(arrow.float64(), 3)
    evidence = arrow.struct([(name, arrow.int64()) for name in ("supporting", "occluded", "contradicting")])
    volume = arrow.struct([*((name, vector) for name in ("position", "size", "size_std")), ("yaw", number)])
    return [
        arrow.field("id", arrow.string(), nullable=False),
        arrow.field("label", arrow.string(), nullable=False),
        ("name", arrow.string()),  # that somebody gave it; mostly null
        ("probability", number),  # P(label | it exists)
        ("existence", number),  # P(it exists)
        ("class_posterior", arrow.map_(arrow.string(), number)),  # P(label | it exists); below 1e-4 left out
        ("position", vector),  # m, map frame
        ("position_covariance", arrow.list_(vector, 3)),  # m^2
        ("size", vector),  # m, along the box's axes, the third along up
        ("size_std", vector),  # m
        ("yaw", number),  # rad about up
        ("corners", arrow.list_(vector, 8)),  # m, map frame; round the bottom, then round the top
        ("first_seen", number),  # s
        ("last_seen", number),  # s
        ("evidence", evidence),  # views
        ("points", arrow.int64()),  # of the labelled cloud; null where it is not labelled
        ("volume", volume),  # what the graph had, where the points have told better; else null
    ]


def _thing_rows(object_map: ObjectMap) -> list[dict[str, Any]]:
    rows = []
    for thing in object_map.things:
        row = thing_to_dict(thing)
        posterior = list(row["class_posterior"].items())
        rows.append(
            {**row, "class_posterior": posterior, "corners": thing.corners(object_map.R_world_upright).tolist()}
        )
    return rows


def _view_fields(arrow: Any) -> list[Any]:
    number = arrow.float64()
    return [
        arrow.field("thing", arrow.string(), nullable=False),
        ("keyframe", arrow.int32()),
        ("stamp", number),  # s
        ("frame", arrow.string()),
        ("verdict", arrow.string()),  # supported, occluded, missed, seen_through, unclear
        ("says", arrow.string()),  # supported, contradicted, said nothing
        ("visible", arrow.struct([(name, number) for name in PART_NAMES])),  # shares of its parts that the camera saw
        ("score", number),  # of the detection; null without one
        ("part", arrow.string()),  # that the detection shows
        ("found_as", arrow.string()),  # class of the detection
        ("weight", number),  # in [0, 1]: how new the view was
        ("log_ratio", arrow.map_(arrow.string(), number)),  # nats, by class: view for such a thing against none
    ]


def _view_rows(object_map: ObjectMap) -> list[dict[str, Any]]:
    """What was kept whole; views that said nothing and are only counted are not rows."""
    found = {thing.id: thing.views.find() for thing in object_map.things if thing.views is not None}
    known = {name: views for name, views in found.items() if views is not None}
    if object_map.things and not known:
        raise UserError(
            f"the map of {object_map.source} was written without the views of its things (evidence.npz); "
            "map again with `thingmap run`, or export --table things"
        )
    return [_view_row(name, note, views.classes) for name, views in known.items() for note in views.notes]


def _view_row(thing: str, note: ViewNote, classes: tuple[str, ...]) -> dict[str, Any]:
    return {
        "thing": thing,
        "keyframe": note.keyframe,
        "stamp": note.stamp,
        "frame": note.frame,
        "verdict": note.verdict.name.lower(),
        "says": REASONS[note.verdict][0],
        "visible": dict(zip(PART_NAMES, note.visible.tolist(), strict=True)),
        "score": float(note.score) if np.isfinite(note.score) else None,
        "part": PART_NAMES[note.part] if note.part >= 0 else None,
        "found_as": classes[note.class_id] if note.class_id >= 0 else None,
        "weight": float(note.weight),
        "log_ratio": list(zip(classes, note.log_ratio.tolist(), strict=True)),
    }


def _pose_fields(arrow: Any) -> list[Any]:
    number = arrow.float64()
    return [
        arrow.field("stamp", number, nullable=False),  # s
        ("position", arrow.list_(number, 3)),  # m, of the camera in the map's frame
        ("quaternion", arrow.list_(number, 4)),  # x, y, z, w of T_world_camera
        ("keyframe", arrow.bool_()),  # null where the run has no list of them
    ]


def _pose_rows(folder: OutputFolder) -> list[dict[str, Any]]:
    stamps, poses = folder.read_trajectory()
    chosen: list[bool | None] = [None] * len(stamps)
    if folder.keyframes_file.is_file():
        keyframes = np.sort(read_poses(folder, keyframes=True)[0])
        after = np.searchsorted(keyframes, stamps - ROUNDING)
        near = np.append(keyframes, np.inf)[after]
        chosen = (near <= stamps + ROUNDING).tolist()
    columns = stamps.tolist(), poses[:, :3, 3].tolist(), quaternions(poses[:, :3, :3]).tolist(), chosen
    names = "stamp", "position", "quaternion", "keyframe"
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]
