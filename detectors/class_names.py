"""Class names from a text or YAML file."""

from __future__ import annotations

from pathlib import Path

from ..datasets.errors import InputError
from .checks import checked_classes

_REMEDY = "write one name per line, or YAML with `names:` as a list or as 0: name, 1: name, ..."


def read_class_names(path: str | Path) -> tuple[str, ...]:
    """Names in the order of a detector's class numbers, from one name per line or from the `names:` of a YAML file.

    Raises:
        InputError: for a missing or unreadable file, no names, a name twice or an empty one.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(path, "a file of class names", "no such file", "check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, "a text file of class names", str(error), _REMEDY) from None
    try:
        names = _from_yaml(text) if path.suffix.lower() in (".yaml", ".yml") else text.rstrip().splitlines()
        names = checked_classes([str(name).strip() for name in names])
        if not names or "" in names:
            raise ValueError("an empty name" if names else "no names")
    except ValueError as error:
        raise InputError(path, "class names", str(error), _REMEDY) from None
    return names


def _from_yaml(text: str) -> list:
    """The value of `names:`: a list, or a map from 0..K-1."""
    import yaml

    try:
        content = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(f"invalid YAML ({' '.join(str(error).split())})") from None
    names = content.get("names") if isinstance(content, dict) else None
    if isinstance(names, list):
        return names
    if isinstance(names, dict):
        return in_order(names)
    raise ValueError("no `names:`")


def in_order(names: dict) -> list:
    """Values of a map whose keys are 0..K-1, in that order.

    Raises:
        ValueError: for other keys.
    """
    if set(names) != set(range(len(names))):
        raise ValueError(f"class numbers {sorted(names, key=str)} instead of 0..{len(names) - 1}")
    return [names[i] for i in range(len(names))]
