"""Checked access to a JSON object: every mistake becomes an `InputError` that names its place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import InputError

REMEDY = "correct that value or write the map again with `thingmap run`"


class Record:
    """A JSON object of a file, with its place in it, such as `things[3].evidence`.

    Each method gives the value of a key as the type it is named after, or raises `InputError`.
    """

    def __init__(self, value: Any, file: Path, place: str = "") -> None:
        self._file, self._place = file, place
        if not isinstance(value, dict):
            raise InputError(file, f"an object at {place or 'the top'}", _describe(value), REMEDY)
        self._value = value

    def text(self, key: str) -> str:
        return self._typed(key, str, "a string")

    def texts(self, key: str) -> tuple[str, ...]:
        values = self._typed(key, list, "a list of strings")
        if not all(isinstance(value, str) for value in values):
            raise self._wrong(key, "a list of strings", values)
        return tuple(values)

    def choice(self, key: str, allowed: Sequence[str]) -> str:
        value = self.text(key)
        if value not in allowed:
            raise self._wrong(key, "one of " + ", ".join(f'"{name}"' for name in allowed), value)
        return value

    def number(self, key: str) -> float:
        value = self._get(key)
        if not _is_number(value):
            raise self._wrong(key, "a number", value)
        return float(value)

    def count(self, key: str) -> int:
        value = self._get(key)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise self._wrong(key, "a whole number >= 0", value)
        return value

    def array(self, key: str, shape: tuple[int, ...]) -> np.ndarray:
        """float64 array of exactly this shape; values may be any numbers that JSON can hold."""
        value = self._get(key)
        try:
            array = np.asarray(value)
        except ValueError:  # a ragged list
            array = np.asarray(None)
        if array.shape != shape or array.dtype.kind not in "if":
            raise self._wrong(key, f"{' x '.join(map(str, shape))} numbers", value)
        return array.astype(np.float64)

    def numbers_by_name(self, key: str) -> dict[str, float]:
        values = self._typed(key, dict, "an object of numbers")
        for name, value in values.items():
            if not _is_number(value):
                raise self._wrong(f"{key}.{name}", "a number", value)
        return {name: float(value) for name, value in values.items()}

    def record(self, key: str) -> Record:
        return Record(self._get(key), self._file, self._at(key))

    def records(self, key: str) -> Iterator[Record]:
        for index, value in enumerate(self._typed(key, list, "a list")):
            yield Record(value, self._file, f"{self._at(key)}[{index}]")

    @contextmanager
    def explaining(self) -> Iterator[None]:
        """A `ValueError` of what is built from this object becomes an `InputError` about it."""
        try:
            yield
        except (ValueError, OverflowError) as error:
            raise InputError(self._file, f"valid values at {self._place or 'the top'}", str(error), REMEDY) from None

    def _get(self, key: str) -> Any:
        if key not in self._value:
            raise InputError(self._file, f"the key {self._at(key)}", "no such key", REMEDY)
        return self._value[key]

    def _typed(self, key: str, kind: type, expected: str) -> Any:
        value = self._get(key)
        if not isinstance(value, kind):
            raise self._wrong(key, expected, value)
        return value

    def _at(self, key: str) -> str:
        return f"{self._place}.{key}" if self._place else key

    def _wrong(self, key: str, expected: str, value: Any) -> InputError:
        return InputError(self._file, f"{expected} at {self._at(key)}", _describe(value), REMEDY)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _describe(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
