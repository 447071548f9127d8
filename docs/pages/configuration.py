"""The reference of the configuration: names, types and defaults of its dataclasses, and the comments beside them."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import io
import textwrap
import tokenize
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_type_hints

from thingmap.mapper.config import MapperConfig

LINE = 120  # characters; a comment goes on in the next line where the next word would not have fitted

HEAD = """# Configuration

Every number of the mapper. `thingmap run --config FILE` takes a YAML file that overrides any of them; unknown keys are
errors. A run writes all of them, as they were used, into `OUT/config.yaml`.

```yaml
seed: 3
keyframes:
  translation: 0.04
```

The last column is what the code says of the number: its unit, and where it comes from.
"""


@dataclasses.dataclass(frozen=True)
class Field:
    """One number of the configuration."""

    name: str
    type: str
    default: str
    comment: str


def configuration_page() -> str:
    """The page, in Markdown."""
    parts = [HEAD, "## Top level", _table(_plain_fields(MapperConfig))]
    for path, section in sections(MapperConfig):
        parts += [f"## `{path}`", " ".join(inspect.getdoc(section).split()), _table(_plain_fields(section))]
    return "\n\n".join(part for part in parts if part) + "\n"


def sections(config: type, path: str = "") -> list[tuple[str, type]]:
    """Every dataclass inside a configuration, with the keys that lead to it, in the order of the fields."""
    found = []
    for field, hint in _hints(config):
        if dataclasses.is_dataclass(hint):
            key = f"{path}.{field.name}" if path else field.name
            found += [(key, hint), *sections(hint, key)]
    return found


def _plain_fields(config: type) -> list[Field]:
    comments = field_comments(config)
    fields = []
    for field, hint in _hints(config):
        if dataclasses.is_dataclass(hint):
            continue
        default = field.default if field.default is not dataclasses.MISSING else field.default_factory()
        fields.append(Field(field.name, _type(hint, field.type), _value(default), comments.get(field.name, "")))
    return fields


def _hints(config: type) -> list[tuple[dataclasses.Field[Any], Any]]:
    hints = get_type_hints(config)
    pairs = []
    for field in dataclasses.fields(config):
        alternatives = [part for part in get_args(hints[field.name]) if part is not NoneType]
        nested = [part for part in alternatives if dataclasses.is_dataclass(part)]
        pairs.append((field, nested[0] if len(nested) == 1 == len(alternatives) else hints[field.name]))
    return pairs


def field_comments(config: type) -> dict[str, str]:
    """What the source says beside each field, and in comment lines that go with it."""
    source = textwrap.dedent(inspect.getsource(config))
    lines = source.splitlines()
    comments = {}
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            comments[token.start[0]] = (
                token.string.lstrip("# "),
                not lines[token.start[0] - 1][: token.start[1]].strip(),
            )
    fields = [node for node in ast.parse(source).body[0].body if isinstance(node, ast.AnnAssign)]  # type: ignore
    told: dict[str, list[str]] = {node.target.id: [] for node in fields}  # type: ignore
    of_line = {line: node.target.id for node in fields for line in range(node.lineno, node.end_lineno + 1)}  # type: ignore
    current, goes_on, above = "", False, []
    for number, line in enumerate(lines, start=1):
        text, alone = comments.get(number, ("", False))
        if number in of_line:
            current = of_line[number]
            told[current] += [*above, *([text] if text else [])]
            above, goes_on = [], bool(text)
        elif alone:
            fits = len(lines[number - 2]) + 1 + len(text.split(" ", 1)[0]) <= LINE
            if goes_on and not fits:
                told[current].append(text)
            else:
                above.append(text)
                goes_on = False
        elif not line.strip():
            goes_on = False
    return {name: " ".join(parts) for name, parts in told.items()}


def _type(hint: Any, written: Any) -> str:
    if isinstance(hint, type) and issubclass(hint, Enum):
        return " \\| ".join(f"`{member.value}`" for member in hint)
    return f"`{written if isinstance(written, str) else getattr(written, '__name__', written)}`".replace("|", "\\|")


def _value(value: Any) -> str:
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, Path):
        value = str(value)
    if isinstance(value, tuple):
        value = list(value)
    return "" if value in ("", None) else f"`{value}`".replace("|", "\\|")


def _table(fields: list[Field]) -> str:
    if not fields:
        return ""
    rows = ["| key | type | default | unit and source |", "|---|---|---|---|"]
    for field in fields:
        comment = field.comment.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
        rows.append(f"| `{field.name}` | {field.type} | {field.default} | {comment} |")
    return "\n".join(rows)
