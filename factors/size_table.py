"""The table of class sizes as people write it: `class_sizes.yaml` and users' own files of the same form."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from ..datasets.errors import InputError

DIMENSIONS = ("length", "width", "height")
_FIELDS = {"size", "spread", "footprint", "resting", "aliases", "source"}
_REMEDY = "see the head of thingmap/factors/class_sizes.yaml for the form"


@dataclass(frozen=True, slots=True)
class SizeEntry:
    """One class of things.

    Attributes:
        size: length, width, height in metres (medians), the thing standing as in ordinary use.
        spread: standard deviation of the log of each.
        round: whether the footprint is an ellipse, so that turning about the vertical hardly changes the extents.
        resting: weight of the poses with length, width or height along the vertical; sums to 1.
        aliases: other names of the class.
        source: where the figures come from.
    """

    size: tuple[float, float, float]
    spread: tuple[float, float, float]
    round: bool
    resting: tuple[float, float, float]
    aliases: tuple[str, ...]
    source: str


def plain_name(name: str) -> str:
    """Class names compare without case, `_` and `-` being spaces."""
    return " ".join(name.lower().replace("_", " ").replace("-", " ").split())


def read_size_table(path: str | Path) -> dict[str, SizeEntry]:
    """Entries by plain name.

    Raises:
        InputError: for a missing or unreadable file, bad YAML, a name or alias used twice, or an entry not of the form.
    """
    path = Path(path)
    try:
        content = yaml.load(path.read_text(encoding="utf-8"), Loader=_UniqueKeys)
    except FileNotFoundError:
        raise InputError(path, "a YAML file of class sizes", "no such file", "check the path") from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(path, "a YAML file of class sizes", " ".join(str(error).split()), _REMEDY) from None
    if not isinstance(content, dict) or not content:
        raise InputError(path, "a mapping from class names to sizes", _short(content), _REMEDY)
    table: dict[str, SizeEntry] = {}
    taken: set[str] = set()
    for name, fields in content.items():
        try:
            entry = _entry(fields)
            names = {plain_name(str(name)), *entry.aliases}
            if twice := sorted(names & taken):
                raise ValueError(f"the name {twice[0]!r}, which another class has")
        except ValueError as error:
            raise InputError(path, f"sizes of the class {name!r}", str(error), _REMEDY) from None
        taken |= names
        table[plain_name(str(name))] = entry
    return table


def _entry(fields: Any) -> SizeEntry:
    if not isinstance(fields, dict):
        raise ValueError(_short(fields))
    if unknown := sorted(str(field) for field in set(fields) - _FIELDS):
        raise ValueError(f"the unknown field {unknown[0]!r}")
    if "size" not in fields:
        raise ValueError("no size")
    size = _three("size", fields["size"], 1e-3, 20.0)
    spread = fields.get("spread", 0.25)
    spread = _three("spread", spread if isinstance(spread, list) else [spread] * 3, 1e-3, 2.0)
    footprint = fields.get("footprint", "rectangle")
    if footprint not in ("rectangle", "round"):
        raise ValueError(f"footprint {_short(footprint)} instead of rectangle or round")
    aliases = fields.get("aliases", [])
    if not isinstance(aliases, list):
        raise ValueError(f"aliases {_short(aliases)} instead of a list of names")
    names = tuple(plain_name(str(alias)) for alias in aliases)
    resting = _resting(fields.get("resting", "upright"))
    return SizeEntry(size, spread, footprint == "round", resting, names, str(fields.get("source", "")))


def _three(field: str, values: Any, low: float, high: float) -> tuple[float, float, float]:
    if not isinstance(values, list) or len(values) != 3:
        raise ValueError(f"{field} {_short(values)} instead of [length, width, height]")
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise ValueError(f"{field} {_short(value)} instead of a number from {low:g} to {high:g}")
    return float(values[0]), float(values[1]), float(values[2])


def _resting(value: Any) -> tuple[float, float, float]:
    """Weights of length, width and height being vertical, from `upright`, `any` or a mapping of weights."""
    if value == "any":
        value = dict.fromkeys(DIMENSIONS, 1.0)
    weights = {"height": 1.0} if value == "upright" else value
    if not isinstance(weights, dict) or not weights or not set(weights) <= set(DIMENSIONS):
        raise ValueError(f"resting {_short(value)} instead of upright, any, or weights of length, width, height")
    for weight in weights.values():
        if isinstance(weight, bool) or not isinstance(weight, int | float) or not 0.0 <= weight < float("inf"):
            raise ValueError(f"the resting weight {_short(weight)} instead of a number from 0")
    total = sum(weights.values())
    if total <= 0.0:
        raise ValueError("resting weights that are all zero")
    length, width, height = (float(weights.get(dimension, 0.0)) / total for dimension in DIMENSIONS)
    return length, width, height


def _short(value: Any) -> str:
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


class _UniqueKeys(yaml.SafeLoader):
    """A mapping key given twice is a mistake, not an override."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, str) and key in seen:
                raise yaml.constructor.ConstructorError(None, None, f"{key!r} is given twice", key_node.start_mark)
            seen.add(str(key))
        return super().construct_mapping(node, deep)
