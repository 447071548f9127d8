"""One YAML file over the defaults of nested frozen dataclasses, and back."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Mapping
from dataclasses import MISSING
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import yaml

from ..datasets.errors import InputError
from .config_values import WrongValue, convert

T = TypeVar("T")


def load_config(path: str | Path | None, cls: type[T], base: T | None = None) -> T:
    """The defaults of `cls`, overridden by what a YAML file says; without a file, the defaults.

    Args:
        path: YAML whose keys are field names and whose mappings are nested dataclasses, or None.
        cls: a dataclass; its fields may be bool, int, float, str, Path, an Enum (by value), a Literal, a dataclass,
            and tuples, lists, dicts and unions of these.
        base: taken for the defaults, where given.

    Raises:
        InputError: the file is absent or not YAML, a key is unknown, given twice or missing, or a value has the wrong
            type or is refused by the dataclass; it names the file and the key.
    """
    if path is None:
        return cls() if base is None else base
    path = Path(path)
    document = _read_yaml(path)
    return _build(cls, {} if document is None else document, _Place(path), MISSING if base is None else base)


def dump_config(instance: Any) -> str:
    """YAML of every field, defaults included, that `load_config` turns back into an equal instance."""
    return yaml.safe_dump(_plain(instance), sort_keys=False, default_flow_style=None, allow_unicode=True, width=120)


@dataclasses.dataclass(frozen=True, slots=True)
class _Place:
    """A key in a file, for messages."""

    file: Path
    key: str = ""

    def __truediv__(self, key: object) -> _Place:
        return _Place(self.file, f"{self.key}.{key}" if self.key else str(key))

    def error(self, expected: str, found: str, remedy: str) -> InputError:
        return InputError(self.file, f"{expected} at {self.key or 'the top'}", found, remedy)


def _build(cls: type[T], node: Any, place: _Place, base: Any = MISSING) -> T:
    """An instance from a YAML mapping; fields that it does not give are taken from `base`, or from the defaults."""
    fields = {field.name: field for field in dataclasses.fields(cls) if field.init}  # type: ignore[arg-type]
    if not isinstance(node, Mapping):
        raise place.error("a mapping of keys to values", describe(node), f"write {_some(fields)} and so on below it")
    for key in node:
        if key not in fields:
            raise _unknown(key, fields, place)
    hints = get_type_hints(cls)
    values: dict[str, Any] = {}
    for name, field in fields.items():
        default = getattr(base, name) if base is not MISSING else _default(field)
        if name in node:
            values[name] = _value(hints[name], node[name], place / name, default)
        elif default is not MISSING:
            values[name] = default
        else:
            raise (place / name).error("a value", "no such key", f"add {(place / name).key} to the file")
    try:
        return cls(**values)
    except ValueError as error:
        raise place.error("valid values", str(error), "correct them") from None


def _value(hint: Any, node: Any, place: _Place, default: Any) -> Any:
    def nested(cls: type, inner: Any, key: str) -> Any:
        base = default if isinstance(default, cls) and not key else MISSING
        return _build(cls, inner, place / key if key else place, base)

    try:
        return convert(hint, node, nested)
    except WrongValue as wrong:
        where = place / wrong.key if wrong.key else place
        raise where.error(wrong.expected, describe(wrong.found), f"give {where.key} {wrong.expected}") from None


def _default(field: dataclasses.Field[Any]) -> Any:
    return field.default_factory() if field.default_factory is not MISSING else field.default


def _unknown(key: Any, fields: Mapping[str, Any], place: _Place) -> InputError:
    near = difflib.get_close_matches(str(key), fields, n=1, cutoff=0.5)
    remedy = f"did you mean {(place / near[0]).key}?" if near else f"the keys there are {_some(fields, 99)}"
    return InputError(place.file, f"a known key at {place.key or 'the top'}", f"{(place / key).key}", remedy)


def _some(names: Mapping[str, Any], count: int = 2) -> str:
    return ", ".join(list(names)[:count])


def describe(value: Any) -> str:
    """A value as a message shows it: shortened, with its type."""
    if value is None:
        return "nothing"
    text = repr(value)
    return f"{text if len(text) <= 40 else text[:37] + '...'} ({type(value).__name__})"


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value) if field.init}
    if isinstance(value, Enum):
        return _plain(value.value)
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {_plain(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(inner) for inner in value]
    for kind in (bool, int, float, str):  # NumPy's and enum's subclasses become the plain type
        if isinstance(value, kind):
            return kind(value)
    return value


class _Loader(yaml.SafeLoader):
    """SafeLoader that refuses a key given twice, of which it would silently take the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key_node, _ in node.value:
            key = key_node.value if isinstance(key_node, yaml.ScalarNode) else None
            if key is not None and key in seen:
                raise yaml.constructor.ConstructorError(None, None, f"{key} is given twice", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep)


def _read_yaml(path: Path) -> Any:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(path, "a configuration file", reason.lower(), "check the path given to --config") from None
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f" at line {mark.line + 1}" if mark else ""
        raise InputError(path, "YAML", f"{getattr(error, 'problem', None) or error}{line}", "correct it") from None
