"""Training on disk after each round: whoever goes on from it gets the model that an uninterrupted run would give.

Negatives are written as the places they were found at; their features come from the frames again. So the file is small,
and holds nothing of anybody's images.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ....datasets.errors import InputError
from ...model_file import read_document, write_document
from .learner import Learner

SCHEMA = "thingmap-hog-training/1"


@dataclass(frozen=True, slots=True, eq=False)
class Checkpoint:
    """What a file said.

    Attributes:
        rounds: done.
        places: (N, 4) int32 of the negatives, for each learner.
    """

    rounds: int
    places: tuple[np.ndarray, ...]


def save_checkpoint(path: Path, settings: Mapping[str, Any], rounds: int, learners: Sequence[Learner]) -> None:
    """Write the state after `rounds`; raises `UserError` where the place cannot be written.

    Args:
        path: of the file.
        settings: everything that the result depends on, as JSON.
        rounds: done.
        learners: all of them.
    """
    arrays, rows = {}, []
    for number, one in enumerate(learners):
        arrays[f"weights_{number}"] = one.template.weights
        arrays[f"places_{number}"] = one.negatives.place
        rows.append({"scale_weight": one.template.scale_weight, "bias": one.template.bias, "done": one.done})
    document = {"schema": SCHEMA, "settings": dict(settings), "rounds": rounds, "learners": rows}
    write_document(path, document, arrays)


def load_checkpoint(path: Path, settings: Mapping[str, Any], learners: Sequence[Learner]) -> Checkpoint | None:
    """The state in the file, given to the learners but for their negatives; None where there is no file.

    Raises:
        InputError: the file is broken, something else, or of a training with other settings or sources.
    """
    if not path.exists():
        return None
    remedy = "remove it to start over, or choose another output"
    expected = "the checkpoint of this training"
    document, arrays = read_document(path, SCHEMA, expected, remedy)
    try:
        if document["settings"] != dict(settings):
            other = sorted(name for name in settings if document["settings"].get(name) != settings[name])
            raise InputError(path, expected, f"one of another training ({', '.join(other)} differ)", remedy)
        places = []
        for number, (one, row) in enumerate(zip(learners, document["learners"], strict=True)):
            weights = arrays[f"weights_{number}"].reshape(one.template.weights.shape)
            numbers = {"scale_weight": float(row["scale_weight"]), "bias": float(row["bias"])}
            one.template = replace(one.template, weights=weights, **numbers)
            one.done = bool(row["done"])
            places.append(arrays[f"places_{number}"].reshape(-1, 4))
        return Checkpoint(int(document["rounds"]), tuple(places))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(path, expected, f"a broken one ({error})", remedy) from None
