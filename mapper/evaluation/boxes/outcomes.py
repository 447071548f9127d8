"""Ranked outcomes as a table of a report, from which several scenes can be pooled later."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..result import ProtocolResult, Table
from .curves import Scored

OUTCOMES = "Scored outcomes"  # title of the table
ALL = "all classes"
COLUMNS = ("views", "class", "images", "objects", "beliefs of right boxes", "beliefs of false boxes")

Outcomes = dict[tuple[int, str], Scored]  # by number of views and class; `ALL` for all


def write_outcomes(outcomes: Outcomes) -> Table:
    """A row a number of views and class: what there was to find, and the scores of what was claimed, as text."""
    rows = []
    for (views, label), one in outcomes.items():
        row = (str(views), label, one.images, one.objects, _text(one.scores[one.right]), _text(one.scores[~one.right]))
        rows.append(row)
    return Table(OUTCOMES, COLUMNS, tuple(rows), folded=True)


def read_outcomes(result: ProtocolResult | Mapping[str, Any]) -> Outcomes:
    """Back from a result, or from what `ProtocolResult.to_dict` made of it.

    Raises:
        ValueError: there is no such table.
    """
    content = result.to_dict() if isinstance(result, ProtocolResult) else result
    tables = [table for table in content.get("tables", ()) if table["title"] == OUTCOMES]
    if len(tables) != 1 or tuple(tables[0]["columns"]) != COLUMNS:
        raise ValueError(f"expected a result with a table {OUTCOMES!r}, got {content.get('protocol')!r}")
    return {(int(row[0]), row[1]): _read(row) for row in tables[0]["rows"]}


def _read(row: Sequence[Any]) -> Scored:
    _, _, images, objects, right, wrong = row
    scores = [np.array([float(word) for word in text.split()]) for text in (right, wrong)]
    flags = np.repeat([True, False], [len(scores[0]), len(scores[1])])
    return Scored(np.concatenate(scores), flags, int(objects), int(images))


def _text(scores: Iterable[float]) -> str:
    return " ".join(f"{score:.9g}" for score in sorted(scores, reverse=True))
