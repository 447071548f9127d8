"""Training on disk after each class: whoever goes on from it gets the model that an uninterrupted run would give."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....datasets.errors import InputError
from ...model_file import read_document, write_document

SCHEMA = "thingmap-shape-context-training/1"


@dataclass(frozen=True, slots=True, eq=False)
class JudgedClass:
    """What is known of a class when every radius was tried on it.

    Attributes:
        areas: (R,) how well each of the candidates, by size, tells it from all else.
        about: how that came to be, JSON.
        skipped: name -> reason of views that could not be used.
    """

    areas: np.ndarray
    about: Mapping[str, Any]
    skipped: Mapping[str, str]


def save_checkpoint(path: Path, settings: Mapping[str, Any], judged: Mapping[str, JudgedClass]) -> None:
    """Write the classes that are done; raises `UserError` where the place cannot be written.

    Args:
        path: of the file.
        settings: everything that the result depends on, as JSON.
        judged: by label.
    """
    rows = [
        {"label": label, "areas": one.areas.tolist(), "about": dict(one.about), "skipped": dict(one.skipped)}
        for label, one in judged.items()
    ]
    write_document(path, {"schema": SCHEMA, "settings": dict(settings), "classes": rows}, {})


def load_checkpoint(path: Path, settings: Mapping[str, Any]) -> dict[str, JudgedClass]:
    """The classes that are done, by label; none where there is no file.

    Raises:
        InputError: the file is broken, something else, or of a training with other settings or sources.
    """
    if not path.exists():
        return {}
    remedy = "remove it to start over, or choose another output"
    expected = "the checkpoint of this training"
    document, _ = read_document(path, SCHEMA, expected, remedy)
    try:
        if document["settings"] != dict(settings):
            other = sorted(name for name in settings if document["settings"].get(name) != settings[name])
            raise InputError(path, expected, f"one of another training ({', '.join(other)} differ)", remedy)
        return {
            str(row["label"]): JudgedClass(np.array(row["areas"], dtype=float), row["about"], dict(row["skipped"]))
            for row in document["classes"]
        }
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(path, expected, f"a broken one ({error})", remedy) from None
