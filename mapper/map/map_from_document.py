"""A map from the JSON values of a "thingmap/1" document, with every mistake named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import InputError
from ...datasets.frame import Intrinsics
from ...datasets.json_record import JsonRecord
from ..edits.stored import applied_from
from .appearance import EmbeddingFile
from .labelled_cloud import LabelledCloud
from .map_to_document import SCHEMA
from .object_map import MapFrame, ObjectMap
from .things_from_document import things_from
from .up_direction import UpDirection
from .views_file import EvidenceFile, evidence_path

FILE_NAME = "map.json"
CLOUD_NAME = "cloud.ply"
REMEDY = "correct that value or write the map again with `thingmap run`"


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
            things=things_from(root, evidence, embeddings),
            classes=root.texts("classes"),
            source=root.text("source"),
            frame=MapFrame(root.choice("frame", tuple(MapFrame))),
            up=_up_from(up),
            labels=_labels_of(root, file),
            camera=_camera_from(root.record("camera")) if "camera" in root else None,
            cloud=_cloud_beside(file),
            edits=applied_from(root),
        )


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
