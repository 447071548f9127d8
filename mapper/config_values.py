"""YAML values to annotated types."""

from __future__ import annotations

import dataclasses
import re
import types
from collections.abc import Callable, Mapping
from contextlib import suppress
from enum import Enum
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

EXPONENT = re.compile(r"[-+]?[0-9]+[eE][-+]?[0-9]+")  # YAML 1.1 takes 1e-3 for text, as it wants 1.0e-3
Nested = Callable[[type, Any, str], Any]  # builds a dataclass from a node found at a key below the value


class WrongValue(Exception):
    """A value that is not of its type; `key` says where inside the value, "" for the value itself."""

    def __init__(self, expected: str, found: Any, key: str = "") -> None:
        self.expected, self.found, self.key = expected, found, key
        super().__init__(expected)


def convert(hint: Any, node: Any, nested: Nested, key: str = "") -> Any:
    """`node`, as YAML gave it, as a value of type `hint`; raises `WrongValue`."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hint is Any:
        return node
    if origin in (Union, types.UnionType):
        return _union(arguments, node, nested, key)
    if origin is Literal:
        return _among(arguments, node, key)
    if origin is tuple or hint is tuple:
        return _tuple(arguments, node, nested, key)
    if origin is list or hint is list:
        return [convert(arguments[0] if arguments else Any, v, nested, _in(key, i)) for i, v in _items(node, key)]
    if origin in (dict, Mapping) or hint is dict:
        return _dict(arguments or (Any, Any), node, nested, key)
    if dataclasses.is_dataclass(hint):
        return nested(hint, node, key)  # type: ignore[arg-type]
    if isinstance(hint, type) and issubclass(hint, Enum):
        return hint(_among(tuple(member.value for member in hint), node, key))
    return _scalar(hint, node, key)


def _scalar(hint: Any, node: Any, key: str) -> Any:
    if hint is type(None):
        if node is None:
            return None
        raise WrongValue("nothing (null)", node, key)
    if hint is bool and isinstance(node, bool):
        return node
    if hint is int and isinstance(node, int) and not isinstance(node, bool):
        return node
    if hint is float:
        return _float(node, key)
    if hint is str and isinstance(node, str):
        return node
    if hint is Path and isinstance(node, str):
        return Path(node)
    if hint not in _NAMES:
        raise TypeError(f"a configuration cannot hold a {hint!r}")
    raise WrongValue(_NAMES[hint], node, key)


_NAMES = {bool: "true or false", int: "a whole number", float: "a number", str: "text", Path: "a path"}


def _float(node: Any, key: str) -> float:
    if isinstance(node, str) and EXPONENT.fullmatch(node):
        return float(node)
    if isinstance(node, int | float) and not isinstance(node, bool):
        with suppress(OverflowError):  # of an integer with hundreds of digits
            return float(node)
    raise WrongValue("a number", node, key)


def _union(arguments: tuple[Any, ...], node: Any, nested: Nested, key: str) -> Any:
    """The member of exactly the value's type, else the first that takes it."""
    if node is None and type(None) in arguments:
        return None
    expected = []
    for argument in sorted(arguments, key=lambda argument: argument is not type(node)):
        if argument is type(None):
            continue
        try:
            return convert(argument, node, nested, key)
        except WrongValue as wrong:
            if len(arguments) == 2 and type(None) in arguments and wrong.key != key:
                raise  # the only choice: say what is wrong inside it
            expected.append(wrong.expected)
    if type(None) in arguments:
        expected.append("nothing (null)")
    raise WrongValue(" or ".join(expected), node, key)


def _among(allowed: tuple[Any, ...], node: Any, key: str) -> Any:
    for value in allowed:
        if type(value) is type(node) and value == node:  # 1 is neither 1.0 nor true here
            return value
    raise WrongValue("one of " + ", ".join(str(value) for value in allowed), node, key)


def _tuple(arguments: tuple[Any, ...], node: Any, nested: Nested, key: str) -> tuple[Any, ...]:
    items = _items(node, key)
    if not arguments:
        return tuple(value for _, value in items)
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        return tuple(convert(arguments[0], value, nested, _in(key, i)) for i, value in items)
    if len(items) != len(arguments):
        raise WrongValue(f"a list of {len(arguments)} values", node, key)
    return tuple(convert(a, value, nested, _in(key, i)) for a, (i, value) in zip(arguments, items, strict=True))


def _dict(arguments: tuple[Any, ...], node: Any, nested: Nested, key: str) -> dict[Any, Any]:
    if not isinstance(node, Mapping):
        raise WrongValue("a mapping of keys to values", node, key)
    return {
        convert(arguments[0], k, nested, _in(key, k)): convert(arguments[1], v, nested, _in(key, k))
        for k, v in node.items()
    }


def _items(node: Any, key: str) -> list[tuple[int, Any]]:
    if not isinstance(node, list):
        raise WrongValue("a list", node, key)
    return list(enumerate(node))


def _in(key: str, inner: object) -> str:
    return f"{key}.{inner}" if key else str(inner)
