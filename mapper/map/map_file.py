"""`map.json`: the document "thingmap/1", written from a map and read back with every mistake named."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import InputError, UserError
from ...datasets.frame import Intrinsics
from ...datasets.json_record import JsonRecord
from ..edits.stored import applied_from, applied_to_dict, thing_edits_from, thing_edits_to_dict
from .appearance import EmbeddingFile, StoredAppearance, embeddings_path, write_embeddings
from .atomic import make_folder, write_atomic
from .labelled_cloud import LabelledCloud
from .object_map import MapFrame, ObjectMap
from .thing import Evidence, Thing
from .up_direction import UpDirection
from .views_file import EvidenceFile, StoredViews, evidence_path, write_views

SCHEMA = "thingmap/1"
FILE_NAME = "map.json"
CLOUD_NAME = "cloud.ply"
DOUBTFUL_BELOW = 0.5  # existence: what more likely is not there is not written, unless asked for
REMEDY = "correct that value or write the map again with `thingmap run`"
NEGLIGIBLE = 1e-4  # class probability that is not written


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
        written, things = _written(object_map, include_doubtful), document.pop("things")
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


def to_document(object_map: ObjectMap, include_doubtful: bool = False) -> dict[str, Any]:
    """The map as plain JSON values.

    Class probabilities below 1e-4 are left out and the others are kept as they are, not scaled up: what is missing from
    a sum of 1 belongs to the classes that are absent, and dividing by the sum renormalises.
    """
    up, labels = object_map.up, object_map.labels
    camera = {} if object_map.camera is None else {"camera": asdict(object_map.camera)}
    labelled = {} if labels is None else {"labels": {"file": labels.file.name, "points": dict(labels.points)}}
    return {
        "schema": SCHEMA,
        "source": object_map.source,
        "frame": str(object_map.frame),
        "up": {
            "direction": up.direction.tolist(),
            "std_deg": float(np.degrees(up.std_rad)),
            "source": up.source,
        },
        **camera,
        "classes": list(object_map.classes),
        **labelled,
        **applied_to_dict(object_map.edits),
        "things": [thing_to_dict(thing) for thing in _written(object_map, include_doubtful)],
    }


def _written(object_map: ObjectMap, include_doubtful: bool) -> list[Thing]:
    return [thing for thing in object_map.things if include_doubtful or thing.existence >= DOUBTFUL_BELOW]


def from_document(document: Any, file: Path) -> ObjectMap:
    """The inverse of `to_document`; `file` is named in errors, which are `InputError`."""
    root = JsonRecord(document, file, REMEDY)
    if root.text("schema") != SCHEMA:
        remedy = "open it with the version of thingmap that wrote it"
        raise InputError(file, f'the schema "{SCHEMA}"', repr(root.text("schema")), remedy)
    up = root.record("up")
    evidence, embeddings = _evidence_of(root, file), _embeddings_of(root, file)
    with root.explaining():
        return ObjectMap(
            things=tuple(_thing_from(record, evidence, embeddings) for record in root.records("things")),
            classes=root.texts("classes"),
            source=root.text("source"),
            frame=MapFrame(root.choice("frame", tuple(MapFrame))),
            up=_up_from(up),
            labels=_labels_of(root, file),
            camera=_camera_from(root.record("camera")) if "camera" in root else None,
            cloud=_cloud_beside(file),
            edits=applied_from(root),
        )


def format_document(document: Mapping[str, Any]) -> str:
    """JSON text with one line for each value of a thing: short enough to read, one change a line to compare."""
    lines = []
    for key, value in document.items():
        if key != "things":
            lines.append(f" {json.dumps(key)}: {_compact(value)}")
            continue
        things = (",\n".join(f"   {json.dumps(k)}: {_compact(v)}" for k, v in thing.items()) for thing in value)
        body = ",\n".join(f"  {{\n{thing}\n  }}" for thing in things)
        lines.append(f' "things": [\n{body}\n ]' if body else ' "things": []')
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _compact(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def thing_to_dict(thing: Thing) -> dict[str, Any]:
    """One thing of the document; its classes are ordered by probability."""
    ranked = sorted(thing.class_posterior.items(), key=lambda item: (-item[1], item[0]))
    return {
        "id": thing.id,
        "label": thing.label,
        "probability": thing.probability,
        "existence": thing.existence,
        "class_posterior": {label: p for label, p in ranked if p >= NEGLIGIBLE or label == thing.label},
        "position": thing.position.tolist(),
        "position_covariance": thing.position_covariance.tolist(),
        "size": thing.size.tolist(),
        "size_std": thing.size_std.tolist(),
        "yaw": thing.yaw,
        "first_seen": thing.first_seen,
        "last_seen": thing.last_seen,
        "evidence": asdict(thing.evidence),
        **_points_to_dict(thing),
        **thing_edits_to_dict(thing),
    }


def _points_to_dict(thing: Thing) -> dict[str, Any]:
    """What labelling has added to a thing; nothing where it was not labelled."""
    values = {"points": thing.points}
    for name in ("points_size", "points_size_std"):
        values[name] = None if getattr(thing, name) is None else getattr(thing, name).tolist()
    return {name: value for name, value in values.items() if value is not None}


def _evidence_of(root: JsonRecord, file: Path) -> EvidenceFile:
    """The file of views that the map names; one without a fingerprint where it names none."""
    if "evidence" not in root:
        return EvidenceFile(evidence_path(file), "", file)
    named = root.record("evidence")
    with named.explaining():  # a name that is none, such as one with a slash
        return EvidenceFile(file.with_name(named.name("file")), named.name("sha256"), file)


def _embeddings_of(root: JsonRecord, file: Path) -> EmbeddingFile | None:
    """The file of embeddings that the map names, None where it names none."""
    if "embeddings" not in root:
        return None
    named = root.record("embeddings")
    with named.explaining():  # as for the evidence
        return EmbeddingFile(file.with_name(named.name("file")), named.name("sha256"), file)


def _labels_of(root: JsonRecord, file: Path) -> LabelledCloud | None:
    if "labels" not in root:
        return None
    named = root.record("labels")
    points = named.record("points")
    with named.explaining():  # a name that is none, such as one with a slash
        return LabelledCloud(
            file.with_name(named.name("file")),
            {name: points.count(name) for name in named.numbers_by_name("points")},
        )


def _thing_from(record: JsonRecord, views: EvidenceFile, embeddings: EmbeddingFile | None) -> Thing:
    evidence = record.record("evidence")
    with record.explaining():
        return Thing(
            id=record.text("id"),
            label=record.text("label"),
            probability=record.number("probability"),
            existence=record.number("existence"),
            class_posterior=record.numbers_by_name("class_posterior"),
            position=record.array("position", (3,)),
            position_covariance=record.array("position_covariance", (3, 3)),
            size=record.array("size", (3,)),
            size_std=record.array("size_std", (3,)),
            yaw=record.number("yaw"),
            first_seen=record.number("first_seen"),
            last_seen=record.number("last_seen"),
            evidence=Evidence(*(evidence.count(name) for name in ("supporting", "occluded", "contradicting"))),
            views=StoredViews(views, record.text("id")),
            points=record.count("points") if "points" in record else None,
            **{name: record.array(name, (3,)) for name in ("points_size", "points_size_std") if name in record},
            appearance=None if embeddings is None else StoredAppearance(embeddings, record.text("id")),
            **thing_edits_from(record),
        )


def _up_from(record: JsonRecord) -> UpDirection:
    with record.explaining():
        return UpDirection(
            record.array("direction", (3,)), float(np.radians(record.number("std_deg"))), record.text("source")
        )


def _camera_from(record: JsonRecord) -> Intrinsics:
    width, height = record.count("width"), record.count("height")
    return Intrinsics(width, height, *(record.number(name) for name in ("fx", "fy", "cx", "cy")))


def _cloud_beside(file: Path) -> Path | None:
    """The cloud of the run that wrote `map.json`; a map in a file of its own has none."""
    cloud = file.with_name(CLOUD_NAME)
    return cloud if file.name == FILE_NAME and cloud.is_file() else None
