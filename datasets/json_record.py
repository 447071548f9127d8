"""Checked access to a JSON object in a file: every mistake becomes an `InputError` that names its place."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InputError
from .tables import read_text


class JsonRecord:
    """A JSON object with its place in the file, such as `objects[3]`.

    The methods give the value of a key as what they are named after, or raise `InputError`.

    Args:
        value: what the JSON holds there.
        file: for errors.
        remedy: what the user can do about a wrong file.
        place: for errors; empty for the file's top.

    Raises:
        InputError: the value is not an object.
    """

    def __init__(self, value: Any, file: Path, remedy: str, place: str = "") -> None:
        self._file, self._remedy, self._place = file, remedy, place
        if not isinstance(value, dict):
            raise self._wrong("an object at", place or "the top", value)
        self._value: dict[str, Any] = value

    def __contains__(self, key: str) -> bool:
        return key in self._value

    def anything(self, key: str) -> Any:
        """The value as it is."""
        if key not in self._value:
            raise InputError(self._file, f"the key {self._at(key)}", "no such key", self._remedy)
        return self._value[key]

    def text(self, key: str) -> str:
        value = self.anything(key)
        if not isinstance(value, str):
            raise self._wrong("a string at", self._at(key), value)
        return value

    def name(self, key: str) -> str:
        """A text that is not empty."""
        value = self.anything(key)
        if not isinstance(value, str) or not value:
            raise self._wrong("a name at", self._at(key), value)
        return value

    def choice(self, key: str, allowed: Sequence[str]) -> str:
        value = self.text(key)
        if value not in allowed:
            raise self._wrong("one of " + ", ".join(f'"{name}"' for name in allowed) + " at", self._at(key), value)
        return value

    def texts(self, key: str) -> tuple[str, ...]:
        values = self.anything(key)
        if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
            raise self._wrong("a list of strings at", self._at(key), values)
        return tuple(values)

    def names(self, key: str) -> tuple[str, ...]:
        """Texts that are not empty and differ from each other."""
        values = self.anything(key)
        if not isinstance(values, list) or not all(isinstance(value, str) and value for value in values):
            raise self._wrong("a list of names at", self._at(key), values)
        if len(set(values)) < len(values):
            twice = next(value for k, value in enumerate(values) if value in values[:k])
            raise self._wrong("names that differ at", self._at(key), f"{twice} twice")
        return tuple(values)

    def flag(self, key: str) -> bool:
        value = self.anything(key)
        if not isinstance(value, bool):
            raise self._wrong("true or false at", self._at(key), value)
        return value

    def count(self, key: str) -> int:
        value = self.anything(key)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise self._wrong("a whole number >= 0 at", self._at(key), value)
        return value

    def number(self, key: str, least: float = -np.inf) -> float:
        """A finite number greater than `least`."""
        value = self.anything(key)
        if not _is_number(value) or not -np.inf < value < np.inf or value <= least:
            bound = "" if least == -np.inf else f" > {least:g}"
            raise self._wrong(f"a number{bound} at", self._at(key), value)
        with self.explaining():  # as in `vector`
            return float(value)

    def vector(self, key: str, least: float = -np.inf) -> np.ndarray:
        """(3,) float64, finite, each greater than `least`."""
        value = self.anything(key)
        numbers = isinstance(value, list) and all(map(_is_number, value))
        with self.explaining():  # a whole number of hundreds of digits
            vector = np.array(value if numbers else [], dtype=np.float64)
        if vector.shape != (3,) or not np.isfinite(vector).all() or (vector <= least).any():
            bound = "" if least == -np.inf else f" > {least:g}"
            raise self._wrong(f"three numbers{bound} at", self._at(key), value)
        return vector

    def array(self, key: str, shape: tuple[int, ...]) -> np.ndarray:
        """float64 array of exactly this shape; values may be any numbers that JSON can hold."""
        value = self.anything(key)
        try:
            array = np.asarray(value)
        except ValueError:  # a ragged list
            array = np.asarray(None)
        if array.shape != shape or array.dtype.kind not in "if":
            raise self._wrong(f"{' x '.join(map(str, shape))} numbers at", self._at(key), value)
        return array.astype(np.float64)

    def numbers_by_name(self, key: str) -> dict[str, float]:
        """An object of numbers, any that JSON can hold."""
        values = self.anything(key)
        if not isinstance(values, dict):
            raise self._wrong("an object of numbers at", self._at(key), values)
        for name, value in values.items():
            if not _is_number(value):
                raise self._wrong("a number at", f"{self._at(key)}.{name}", value)
        with self.explaining():  # as in `vector`
            return {name: float(value) for name, value in values.items()}

    def vector_or_unknown(self, key: str, least: float = -np.inf) -> np.ndarray:
        """As `vector`; NaN where the value is null."""
        return np.full(3, np.nan) if self.anything(key) is None else self.vector(key, least)

    def record(self, key: str) -> JsonRecord:
        return JsonRecord(self.anything(key), self._file, self._remedy, self._at(key))

    def records(self, key: str) -> Iterator[JsonRecord]:
        values = self.anything(key)
        if not isinstance(values, list):
            raise self._wrong("a list at", self._at(key), values)
        for index, value in enumerate(values):
            yield JsonRecord(value, self._file, self._remedy, f"{self._at(key)}[{index}]")

    @contextmanager
    def explaining(self) -> Iterator[None]:
        """A `ValueError` of what is built from this object becomes an `InputError` about it."""
        try:
            yield
        except (ValueError, OverflowError) as error:
            expected = f"valid values at {self._place or 'the top'}"
            raise InputError(self._file, expected, str(error), self._remedy) from None

    def _at(self, key: str) -> str:
        return f"{self._place}.{key}" if self._place else key

    def _wrong(self, expected: str, place: str, value: Any) -> InputError:
        text = json.dumps(value, ensure_ascii=False, default=repr)
        found = text if len(text) <= 60 else f"{text[:57]}..."
        return InputError(self._file, f"{expected} {place}", found, self._remedy)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def read_json_record(path: Path, expected: str, remedy: str) -> JsonRecord:
    """The object that a JSON file holds.

    Raises:
        InputError: the file is missing or is not JSON of an object; it says `expected` and `remedy`.
    """
    text = read_text(path, expected, remedy)
    try:
        value = json.loads(text)
    except json.JSONDecodeError as error:
        found = f"no JSON ({error.msg} in line {error.lineno})" if text.strip() else "an empty file"
        raise InputError(path, expected, found, remedy) from None
    except RecursionError:
        raise InputError(path, expected, "JSON that is nested too deeply", remedy) from None
    except ValueError:  # thousands of digits, which Python refuses to turn into a number
        raise InputError(path, expected, "a number of too many digits", remedy) from None
    return JsonRecord(value, path, remedy)
