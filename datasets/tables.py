"""Small text files of numbers and names, read with errors that name the line."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .errors import InputError


def read_text(path: Path, expected: str, remedy: str) -> str:
    """Text of a file.

    Raises:
        InputError: the file is missing or is not text; it says `expected` and `remedy`.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(path, expected, "a file that is not text", remedy) from None
    except OSError as error:
        raise InputError(path, expected, _why(error), remedy) from None


def read_rows(path: Path, columns: str, remedy: str) -> list[tuple[int, list[str]]]:
    """(line number, fields) of every line that is neither blank nor a `#` comment.

    Args:
        path: the file.
        columns: names of the columns, separated by blanks; every row must have as many fields.
        remedy: what the user can do about a file that cannot be read.

    Raises:
        InputError: the file cannot be read, or a row has another number of fields.
    """
    text = read_text(path, f"rows of `{columns}`", remedy)
    rows = []
    for number, line in enumerate(text.splitlines(), start=1):
        fields = line.split()
        if not fields or fields[0].startswith("#"):
            continue
        if len(fields) != len(columns.split()):
            found = f"{len(fields)} fields in line {number}: {line.strip()[:80]!r}"
            raise InputError(path, f"rows of `{columns}`", found, "correct the line, or put # before it")
        rows.append((number, fields))
    return rows


def read_table(path: Path, columns: str, remedy: str = "check the path") -> np.ndarray:
    """(N, C) float64 numbers, one row a line, `nan` allowed; (0, C) where the file holds comments only.

    Raises:
        InputError: the file cannot be read, a row has another number of fields, or a field is not a number.
    """
    rows = read_rows(path, columns, remedy)
    try:
        return np.array([fields for _, fields in rows], dtype=np.float64).reshape(len(rows), len(columns.split()))
    except ValueError:
        number, field = next((number, f) for number, fields in rows for f in fields if not _is_number(f))
        raise InputError(
            path, f"rows of `{columns}`", f"{field!r} in line {number}", "correct the line, or put # before it"
        ) from None


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _why(error: OSError) -> str:
    return "no such file" if isinstance(error, FileNotFoundError) else (error.strerror or str(error)).lower()
