"""Things from the JSON values of a map: all at once where all is well, else one by one, which names the mistake."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from itertools import chain
from typing import Any

import numpy as np

from ...datasets.json_record import JsonRecord
from ..edits.stored import thing_edits_from
from .appearance import EmbeddingFile, StoredAppearance
from .thing import Evidence, Thing
from .thing_checks import POSTERIOR_TOLERANCE, are_covariances
from .views_file import EvidenceFile, StoredViews
from .volume import volume_from

TEXTS = ("id", "label")
NUMBERS = ("probability", "existence", "yaw", "first_seen", "last_seen")
ARRAYS = {"position": (3,), "position_covariance": (3, 3), "size": (3,), "size_std": (3,)}
# a thing with other keys, such as a name, is one of few and read alone
USUAL = frozenset((*TEXTS, *NUMBERS, *ARRAYS, "class_posterior", "evidence", "points"))
COUNTS = ("supporting", "occluded", "contradicting")


def things_from(root: JsonRecord, views: EvidenceFile, embeddings: EmbeddingFile | None) -> tuple[Thing, ...]:
    """The things of a document.

    Args:
        root: the document.
        views, embeddings: files that things will read from when they are asked.

    Raises:
        InputError: a thing is none; it says which and what of it.
    """
    try:
        values = root.anything("things")
        _require(isinstance(values, list))
        quick = [value for value in values if value.keys() <= USUAL]
        things = iter(_at_once(quick, views, embeddings)) if quick else iter(())
        if len(quick) == len(values):
            return tuple(things)
        records = zip(values, root.records("things"), strict=True)
        return tuple(
            next(things) if value.keys() <= USUAL else _thing_from(record, views, embeddings)
            for value, record in records
        )
    # whatever is wrong with a value is said by those who read it alone
    except (LookupError, TypeError, ValueError, OverflowError, AttributeError):
        return tuple(_thing_from(record, views, embeddings) for record in root.records("things"))


def _at_once(values: Sequence[Any], views: EvidenceFile, embeddings: EmbeddingFile | None) -> list[Thing]:
    """Things that have the usual keys only; raises some error where a value is not as `Thing` wants it."""
    texts = {name: _texts(values, name) for name in TEXTS}
    numbers = {name: _numbers(values, name) for name in NUMBERS}
    arrays = {name: _arrays(values, name, shape) for name, shape in ARRAYS.items()}
    ids, labels, probability = texts["id"], texts["label"], numbers["probability"]
    _require(bool(all(labels)) and _in_unit(probability) and _in_unit(numbers["existence"]))
    _require(arrays["size"].min() >= 0.0 and arrays["size_std"].min() >= 0.0)
    _require(are_covariances(arrays["position_covariance"]))
    columns = {
        **texts,
        **{name: column.tolist() for name, column in numbers.items()},
        **arrays,
        "class_posterior": _posteriors(values, labels, probability),
        "evidence": _evidence(values),
        "points": _points(values),
        "views": [StoredViews(views, name) for name in ids],
        "appearance": [None if embeddings is None else StoredAppearance(embeddings, name) for name in ids],
    }
    rest = {field.name: field.default for field in fields(Thing) if field.name not in columns}
    rows = zip(*columns.values(), strict=True)
    return [Thing.of_checked(**dict(zip(columns, row, strict=True)), **rest) for row in rows]


def _texts(values: Sequence[Any], key: str) -> list[str]:
    texts = [value[key] for value in values]
    _require(set(map(type, texts)) == {str})
    return texts


def _numbers(values: Sequence[Any], key: str) -> np.ndarray:
    """(N,) finite float64."""
    numbers = [value[key] for value in values]
    _require(set(map(type, numbers)) <= {int, float})
    column = np.array(numbers, dtype=np.float64)
    _require(bool(np.isfinite(column).all()))
    return column


def _arrays(values: Sequence[Any], key: str, shape: tuple[int, ...]) -> np.ndarray:
    """(N, *shape) finite float64, read-only; its rows are the things' own arrays."""
    arrays = np.array([value[key] for value in values])
    _require(arrays.shape == (len(values), *shape) and arrays.dtype.kind in "if" and bool(np.isfinite(arrays).all()))
    arrays = arrays.astype(np.float64)
    arrays.setflags(write=False)
    return arrays


def _posteriors(values: Sequence[Any], labels: Sequence[str], probability: np.ndarray) -> list[dict[str, float]]:
    posteriors = [value["class_posterior"] for value in values]
    _require(set(map(type, posteriors)) == {dict})
    kept = np.array([posterior[label] for posterior, label in zip(posteriors, labels, strict=True)], dtype=np.float64)
    numbers = list(chain.from_iterable(posterior.values() for posterior in posteriors))
    _require(set(map(type, numbers)) == {float})  # of a whole number, `Thing` makes a float
    first = np.cumsum([0, *map(len, posteriors)])[:-1]
    flat = np.array(numbers)
    _require(_in_unit(flat) and bool(np.all(np.add.reduceat(flat, first) <= 1.0 + POSTERIOR_TOLERANCE)))
    _require(bool(np.all(np.abs(kept - probability) <= POSTERIOR_TOLERANCE)))
    return posteriors


def _evidence(values: Sequence[Any]) -> list[Evidence]:
    counts = [[value["evidence"][name] for value in values] for name in COUNTS]
    _require(set(map(type, chain.from_iterable(counts))) == {int})
    return [Evidence(*three) for three in zip(*counts, strict=True)]


def _points(values: Sequence[Any]) -> list[int | None]:
    known = [value["points"] for value in values if "points" in value]
    _require(set(map(type, known)) <= {int} and min(known, default=0) >= 0)
    return [value.get("points") for value in values]


def _in_unit(column: np.ndarray) -> bool:
    return bool(np.all((column >= 0.0) & (column <= 1.0)))


def _require(well: bool) -> None:
    if not well:
        raise ValueError


def _thing_from(record: JsonRecord, views: EvidenceFile, embeddings: EmbeddingFile | None) -> Thing:
    """One thing; raises `InputError`."""
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
            evidence=Evidence(*(evidence.count(name) for name in COUNTS)),
            views=StoredViews(views, record.text("id")),
            points=record.count("points") if "points" in record else None,
            volume=volume_from(record.record("volume")) if "volume" in record else None,
            appearance=None if embeddings is None else StoredAppearance(embeddings, record.text("id")),
            **thing_edits_from(record),
        )
