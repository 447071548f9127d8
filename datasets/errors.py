"""Errors that a user can act on."""

from __future__ import annotations

from pathlib import Path


class UserError(Exception):
    """A mistake in what the user gave; the command line prints it as one line and exits with 2."""


class InputError(UserError):
    """A file or folder that is not what was expected.

    Args:
        path: the file or folder at fault.
        expected: what should have been there.
        found: what was there instead.
        remedy: what the user can do about it.
    """

    def __init__(self, path: str | Path, expected: str, found: str, remedy: str) -> None:
        self.path, self.expected, self.found, self.remedy = Path(path), expected, found, remedy
        super().__init__(f"{path}: expected {expected}, found {found}; {remedy}")

    def __reduce__(self) -> tuple[type[InputError], tuple[Path, str, str, str]]:
        # Exception pickles its one message; a worker process could not hand the error back
        return type(self), (self.path, self.expected, self.found, self.remedy)
