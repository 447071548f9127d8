"""JSON values to the dataclasses of a report, and back to text that people can read and compare line by line."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from ....datasets.errors import InputError
from ...config_values import WrongValue, convert
from ..result import Series, WorstCase

T = TypeVar("T")
REMEDY = "write the report again with `thingmap evaluate`"


def read_json(file: Path) -> dict[str, Any]:
    """The object that a file holds; raises `InputError` where there is none."""
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(file, "a report", "nothing", "give the REPORT folder of `thingmap evaluate`") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(file, "a readable text file", str(error), "check the file and its permissions") from None
    except json.JSONDecodeError as error:
        where = f"broken JSON at line {error.lineno} ({error.msg})"
        raise InputError(file, "a report in JSON", where, REMEDY) from None
    if not isinstance(document, dict):
        raise InputError(file, "a report in JSON", f"a {type(document).__name__}", REMEDY)
    return document


def build(cls: type[T], values: Any, file: Path) -> T:
    """An instance of a dataclass from what `dataclasses.asdict` and JSON made of one.

    Keys that the class does not have are left out.

    Raises:
        InputError: a value is missing or of another type; it names the key.
    """
    try:
        return _nested(cls, values, "")
    except WrongValue as wrong:
        where = wrong.key or "the top"
        raise InputError(file, f"{wrong.expected} at {where}", _short(wrong.found), REMEDY) from None


def format_json(value: Any, depth: int = 0) -> str:
    """JSON, a line for each value; a list of plain values is one line."""
    inner, end = "\n" + " " * (depth + 1), "\n" + " " * depth
    if isinstance(value, dict) and value:
        items = (f"{json.dumps(key, ensure_ascii=False)}: {format_json(v, depth + 1)}" for key, v in value.items())
        return "{" + inner + f",{inner}".join(items) + end + "}"
    if isinstance(value, list) and any(isinstance(item, dict | list) for item in value):
        return "[" + inner + f",{inner}".join(format_json(item, depth + 1) for item in value) + end + "]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _nested(cls: type[T], node: Any, key: str) -> T:
    """One dataclass at `key`; `convert` calls it for those inside."""
    if not isinstance(node, dict):
        raise WrongValue("an object", node, key)
    if cls is Series:  # what is not finite was written as null
        node = {name: _with_gaps(value) if name in ("x", "y") else value for name, value in node.items()}
    if cls is WorstCase:  # a box without all its sides is none
        node = {name: None if isinstance(value, list) and None in value else value for name, value in node.items()}
    hints = get_type_hints(cls)
    values = {}
    for field in dataclasses.fields(cls):  # type: ignore[arg-type]
        place = f"{key}.{field.name}" if key else field.name
        if field.name in node:
            values[field.name] = convert(hints[field.name], node[field.name], _nested, place)
        elif field.default is dataclasses.MISSING:
            raise WrongValue("a value", "no such key", place)
    return cls(**values)


def _with_gaps(value: Any) -> Any:
    return [float("nan") if item is None else item for item in value] if isinstance(value, list) else value


def _short(value: Any) -> str:
    text = value if isinstance(value, str) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
