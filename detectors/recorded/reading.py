"""Reading JSON, rows of numbers and class names, with errors that say what is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import InputError
from ..checks import checked_classes
from ..class_names import read_class_names
from ..coco import COCO_80
from .recording import Malformed


def load_json(path: Path) -> Any:
    """The content of a JSON file.

    Raises:
        InputError: for a missing file, or one that is no JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(path, "a JSON file", "no such file", "check the path") from None
    except json.JSONDecodeError as error:
        found = f"line {error.lineno}: {error.msg}"
        raise InputError(path, "JSON", found, "check that the file was written completely") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, "a JSON file", str(error), "give a JSON file or a folder of text labels") from None


def read_rows(path: Path, columns: tuple[int, ...]) -> np.ndarray:
    """(N, C) numbers of a text file, blanks between them; C is one of `columns`, the first for an empty file.

    Raises:
        Malformed: for a line that is not numbers, or has another count of them than the file's first.
    """
    rows: list[list[float]] = []
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        if not line.strip():
            continue
        try:
            row = [float(text) for text in line.split()]
        except ValueError:
            raise Malformed(f"line {number}: {line.strip()[:60]!r} instead of numbers") from None
        if len(row) not in ((len(rows[0]),) if rows else columns):
            expected = len(rows[0]) if rows else " or ".join(map(str, columns))
            raise Malformed(f"line {number}: {len(row)} numbers instead of {expected}")
        rows.append(row)
    return np.array(rows) if rows else np.zeros((0, columns[0]))


def class_names(given: tuple[str, ...] | Path | str | None) -> tuple[str, ...]:
    """Names as given or from a file; COCO's 80 for None."""
    if given is None:
        return COCO_80
    return read_class_names(given) if isinstance(given, Path | str) else checked_classes(given)
