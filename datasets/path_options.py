"""What may be told after the path of a recording: `PATH?KEY=VALUE&KEY=VALUE`."""

from __future__ import annotations

from pathlib import Path

from .errors import UserError
from .paths import user_path


def split_options(spec: str | Path) -> tuple[Path, dict[str, str]]:
    """The path and the options told after it; a path that exists as it is written has none.

    Raises:
        UserError: an option is not `KEY=VALUE`, or is told twice.
    """
    path = user_path(spec)
    if isinstance(spec, Path) or "?" not in spec or path.exists():
        return path, {}
    base, _, query = spec.partition("?")
    options: dict[str, str] = {}
    for part in query.split("&"):
        key, equals, value = part.partition("=")
        if not equals or key in options:
            found = f"{key} twice" if key in options else repr(part)
            raise UserError(f"{base}: expected options as KEY=VALUE&KEY=VALUE, found {found}; correct {query!r}")
        options[key] = value
    return user_path(base), options
