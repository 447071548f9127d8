"""Files of learned evidence: JSON for people to look into, and checked number by number when it is read.

    {"schema": "thingmap-evidence/1", "learned_from": "...",
     "classes": [{"name": "mug", "mean": ..., "sigma": ..., "background_mean": ..., "background_sigma": ...,
                  "detection_intercept": ...}, ...],
     "pooled": the same without a name,
     "templates": {"other_sigma": ..., "confusion": ..., "platt_ab": ..., "linear_range": ...,
                   "detection_visible": ..., "detection_side": ...},
     "existence": the fields of `ExistenceModel`,
     "background_size": {"mean": ..., "covariance": ...} or null}

Rows of arrays are templates: whole, top, bottom, left, right. Shapes and units are those of `ScoreModel` and
`DetectionModel`.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_type_hints

import numpy as np

from ..datasets.errors import InputError
from ..datasets.json_record import JsonRecord, read_json_record
from ..datasets.truth_files import write_whole
from . import score_model
from .detection_model import LOG2_SIDE_KNOTS, LOGIT, VISIBLE_KNOTS, DetectionModel
from .existence import ExistenceModel
from .learned_numbers import TEMPLATES, checked_array, checked_gaussian, checked_names
from .score_model import ScoreModel

SCHEMA = "thingmap-evidence/1"
REMEDY = "learn the model again with `thingmap learn`, or leave it out to use the one that is shipped"
DIGITS = 5  # significant ones, in the file
_INTERCEPT = "detection_intercept"
_PER_CLASS = score_model.PER_CLASS | {_INTERCEPT: ((TEMPLATES,), LOGIT)}
_PER_TEMPLATE = score_model.PER_TEMPLATE | {
    "detection_visible": ((TEMPLATES, len(VISIBLE_KNOTS)), LOGIT),
    "detection_side": ((TEMPLATES, len(LOG2_SIDE_KNOTS)), LOGIT),
}
_FINITE = (-1e300, 1e300)


class EvidenceParts(NamedTuple):
    """What a file holds, in the order of the fields of `EvidenceModel`."""

    scores: ScoreModel
    detection: DetectionModel
    existence: ExistenceModel
    learned_from: str
    background_size: tuple[np.ndarray, np.ndarray] | None


def write_evidence(path: Path, parts: EvidenceParts) -> None:
    """Writes the file, whole or not at all, numbers rounded to 5 significant digits.

    Raises:
        UserError: it cannot be written.
    """
    scores, detection = parts.scores, parts.detection
    rows = [
        {name: getattr(scores, name)[k] for name in score_model.PER_CLASS} | {_INTERCEPT: detection.intercept[k]}
        for k in range(len(scores.classes) + 1)
    ]
    size = parts.background_size
    document = {
        "schema": SCHEMA,
        "learned_from": parts.learned_from,
        "classes": [{"name": name} | row for name, row in zip(scores.classes, rows, strict=False)],
        "pooled": rows[-1],
        "templates": {name: getattr(scores, name) for name in score_model.PER_TEMPLATE}
        | {"detection_visible": detection.visible, "detection_side": detection.side},
        "existence": asdict(parts.existence),
        "background_size": None if size is None else {"mean": size[0], "covariance": size[1]},
    }
    write_whole(path, f"{_text(document, '')}\n".encode())


def read_evidence(path: Path) -> EvidenceParts:
    """Reads the file.

    Raises:
        InputError: it is missing or damaged, or a number in it is out of its range; it says where.
    """
    record = read_json_record(path, f"an evidence model ({SCHEMA})", REMEDY)
    if "schema" not in record or record.anything("schema") != SCHEMA:
        found = repr(record.anything("schema")) if "schema" in record else "none"
        raise InputError(path, f'the schema "{SCHEMA}"', found, REMEDY)
    classes = list(record.records("classes"))
    with record.explaining():
        names = checked_names([item.name("name") for item in classes])
    _refuse_strangers(path, record, "classes", ["name", *_PER_CLASS])
    rows = [_numbers(item, _PER_CLASS) for item in (*classes, record.record("pooled"))]
    _refuse_strangers(path, record, "pooled", _PER_CLASS)
    columns = {name: np.array([row[name] for row in rows]) for name in _PER_CLASS}
    templates = _numbers(record.record("templates"), _PER_TEMPLATE)
    _refuse_strangers(path, record, "templates", _PER_TEMPLATE)
    with record.explaining():
        scores = ScoreModel(
            names,
            **{name: columns[name] for name in score_model.PER_CLASS},
            **{name: templates[name] for name in score_model.PER_TEMPLATE},
        )
        detection = DetectionModel(
            names, columns[_INTERCEPT], templates["detection_visible"], templates["detection_side"]
        )
    existence = _existence(record.record("existence"))
    _refuse_strangers(path, record, "existence", [field.name for field in fields(ExistenceModel)])
    return EvidenceParts(scores, detection, existence, record.text("learned_from"), _background_size(path, record))


def _numbers(
    record: JsonRecord, wanted: Mapping[str, tuple[tuple[int, ...], tuple[float, float]]]
) -> dict[str, np.ndarray]:
    """Arrays of these names, each of its shape and within its limits."""
    arrays = {name: record.array(name, shape) for name, (shape, _) in wanted.items()}
    with record.explaining():
        return {name: checked_array(name, arrays[name], *wanted[name]) for name in wanted}


def _existence(record: JsonRecord) -> ExistenceModel:
    """Whatever fields the dataclass has: numbers, and tuples of them of the lengths it is annotated with."""
    shapes = {name: _shape(hint) for name, hint in get_type_hints(ExistenceModel).items()}
    values: dict[str, Any] = {name: record.number(name) for name, shape in shapes.items() if not shape}
    tuples = _numbers(record, {name: (shape, _FINITE) for name, shape in shapes.items() if shape})
    values |= {name: _tuples(array.tolist()) for name, array in tuples.items()}
    with record.explaining():
        return ExistenceModel(**values)


def _background_size(path: Path, record: JsonRecord) -> tuple[np.ndarray, np.ndarray] | None:
    if record.anything("background_size") is None:
        return None
    size = record.record("background_size")
    _refuse_strangers(path, record, "background_size", ["mean", "covariance"])
    mean, covariance = size.array("mean", (3,)), size.array("covariance", (3, 3))
    with size.explaining():
        return checked_gaussian(mean, covariance)


def _refuse_strangers(path: Path, parent: JsonRecord, key: str, known: Collection[str]) -> None:
    """A key that nobody reads would be a number that somebody thinks is used."""
    value = parent.anything(key)
    for item in value if isinstance(value, list) else [value]:
        if strange := sorted(set(item) - set(known)):
            raise InputError(path, f"only the keys {', '.join(known)} at {key}", f"the key {strange[0]!r}", REMEDY)


def _shape(hint: Any) -> tuple[int, ...]:
    """() of a number, (2,) of tuple[float, float], (2, 3) of a pair of triples."""
    inner = get_args(hint)
    return (len(inner), *_shape(inner[0])) if inner else ()


def _tuples(values: Any) -> Any:
    return tuple(map(_tuples, values)) if isinstance(values, list) else values


def _text(value: Any, indent: str) -> str:
    """JSON with every row of numbers on a line of its own."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, float):
        return json.dumps(float(f"{value:.{DIGITS}g}"), allow_nan=False)
    if isinstance(value, dict):
        items, brackets = [f"{json.dumps(key)}: {_text(item, indent + ' ')}" for key, item in value.items()], "{}"
    elif isinstance(value, list | tuple):
        items, brackets = [_text(item, indent + " ") for item in value], "[]"
        if not any(isinstance(item, dict | list | tuple) for item in value):
            return f"[{', '.join(items)}]"
    else:
        return json.dumps(value, ensure_ascii=False)
    inside = f",\n{indent} ".join(items)
    return f"{brackets[0]}\n{indent} {inside}\n{indent}{brackets[1]}"
