"""Paths as people write them."""

from __future__ import annotations

from pathlib import Path

from .errors import InputError


def user_path(text: str | Path) -> Path:
    """The path with a leading `~` or `~name` replaced by that home directory.

    Raises:
        InputError: there is no such user.
    """
    try:
        return Path(text).expanduser()
    except RuntimeError:
        found = "a home directory that is not known"
        raise InputError(text, "a path", found, "write the path without ~") from None
