"""The configuration of a renderer as plain values and back, so that what is on disk can be rendered again."""

from __future__ import annotations

import typing
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Any

from ...errors import InputError
from ...truth_files import FOLDER, REMEDY, TruthPaths, read_record
from ..config import SyntheticConfig
from ..sample import TabletopConfig

KINDS = {kind.__name__: kind for kind in (SyntheticConfig, TabletopConfig)}
KIND = "kind"  # the key that tells which of them it is


def plain_config(config: SyntheticConfig | TabletopConfig) -> dict[str, Any]:
    """Every field, defaults too, as values that JSON can hold; floats keep all their digits.

    A folder of meshes is written as an absolute path.
    """
    return {KIND: type(config).__name__} | _plain_fields(config)


def read_config(folder: Path) -> SyntheticConfig | TabletopConfig:
    """The configuration that rendered a written sequence.

    Raises:
        InputError: the folder has no truth, or its configuration is not of a renderer as it is today.
        UserError: a number in it is outside its limits.
    """
    path = TruthPaths(folder / FOLDER).record
    values = dict(read_record(path).configuration)
    kind = values.pop(KIND, None)
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError(path, f"configuration.{KIND} among {', '.join(KINDS)}", repr(kind), REMEDY)
    try:
        return _built(KINDS[kind], values)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(path, f"a {kind} at configuration", str(error), REMEDY) from None


def _plain_fields(config: Any) -> dict[str, Any]:
    return {field.name: _plain(getattr(config, field.name)) for field in fields(config)}


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return _plain_fields(value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Path):
        return str(value.resolve())
    if isinstance(value, tuple):
        return [_plain(inner) for inner in value]
    return value


def _built(kind: Any, value: Any) -> Any:
    """A value of the annotated type `kind` from its plain form; raises ValueError or TypeError where it is not."""
    if typing.get_origin(kind) in (UnionType, typing.Union):
        options = [option for option in typing.get_args(kind) if option is not NoneType]
        return None if value is None else _built(options[0], value)
    if is_dataclass(kind):
        if not isinstance(value, dict):
            raise ValueError(f"{value!r} where values by name belong")
        hints = typing.get_type_hints(kind)
        if strange := set(value) - set(hints):
            raise ValueError(f"unknown values {', '.join(sorted(strange))}")
        return kind(**{name: _built(hints[name], inner) for name, inner in value.items()})  # pyright: ignore
    if typing.get_origin(kind) is tuple:
        kinds = typing.get_args(kind)
        kinds = kinds[:1] * len(value) if kinds[-1] is Ellipsis else kinds
        return tuple(_built(inner, part) for inner, part in zip(kinds, value, strict=True))
    if kind is Path or (isinstance(kind, type) and issubclass(kind, Enum)):
        return kind(value)
    if not isinstance(value, (int, float) if kind is float else kind) or (isinstance(value, bool) and kind is not bool):
        raise ValueError(f"{value!r} where a {kind.__name__} belongs")
    return kind(value)
