"""Arrays and one JSON document in a single .npz file: read without pickle, written whole or not at all.

The document is the entry `document`, a string: `str(numpy.load(path)["document"])` shows it. Its key `schema` names
what the file is and in which version.
"""

from __future__ import annotations

import json
import os
import zipfile
import zlib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..datasets.errors import InputError, UserError

_DOCUMENT = "document"


def write_document(path: Path, document: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
    """Write a document that has a `schema`, and arrays under names of their own. The same content gives the same bytes.

    Raises:
        UserError: where the place cannot be written.
        TypeError, ValueError: the document is not JSON; nothing is written then.
    """
    text = json.dumps(document, allow_nan=False, sort_keys=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **{_DOCUMENT: np.array(text)}, **arrays)
        temporary.replace(path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise UserError(f"{path}: cannot be written ({reason}); choose a place that exists and is yours") from error
    finally:
        with suppress(OSError):
            temporary.unlink()


def read_document(path: Path, schema: str, kind: str, remedy: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The document and the arrays of a file.

    Args:
        path: of the file.
        schema: that it must have.
        kind: what the file should be, for errors, such as "a HOG model".
        remedy: what to do about another one.

    Raises:
        InputError: for no file, a broken one, one of another kind, or another schema.
    """
    expected = f"{kind} ({schema})"
    try:
        content = np.load(path, allow_pickle=False)
        if not isinstance(content, np.lib.npyio.NpzFile):
            raise ValueError("a single array")
        with content as file:
            arrays = {name: file[name] for name in file.files}
        document = json.loads(str(arrays.pop(_DOCUMENT)))
        found = document["schema"]
    except FileNotFoundError:
        raise InputError(path, expected, "no such file", remedy) from None
    except KeyError as error:
        raise InputError(path, expected, f"no {error.args[0]!r} in it", remedy) from None
    except (OSError, EOFError, ValueError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(path, expected, " ".join(str(error).split()) or "a broken file", remedy) from None
    if found != schema:
        raise InputError(path, expected, repr(found), remedy)
    return document, arrays


def schema_of(path: Path) -> str:
    """The `schema` of a file that `write_document` wrote; empty for none, or any other file."""
    try:
        with np.load(path, allow_pickle=False) as file:
            return str(json.loads(str(file[_DOCUMENT]))["schema"])
    except (OSError, EOFError, KeyError, TypeError, ValueError, AttributeError, zipfile.BadZipFile, zlib.error):
        return ""
