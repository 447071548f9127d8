"""Packages that only some formats need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ...datasets.errors import UserError
from ...datasets.extras import install_command


def optional_module(name: str, package: str, extra: str) -> Any:
    """The module `name` of `package`.

    Raises:
        UserError: it is not installed; the message names the extra that brings it.
    """
    try:
        return import_module(name)
    except ImportError:
        raise UserError(f"{package} is not installed; install it with: {install_command(extra)}") from None
