"""What training puts out and detection takes: a codebook of every class, and what its scores mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import InputError
from ..checks import checked_classes
from ..model_file import read_document, write_document
from .calibration import Calibration
from .codebook import Codebook
from .config import Context, VotingConfig

SCHEMA = "thingmap-shape-context/1"
KIND = "a shape-context model"
REMEDY = "train a model with `thingmap train shape-context`"
LEVELS = 255  # of a descriptor's bins in the file


@dataclass(frozen=True, slots=True, eq=False)
class ShapeContextModel:
    """Everything that `ShapeContextDetector` needs.

    Attributes:
        classes: C names.
        codebooks: C of them.
        calibration: of the classes' scores.
        voting: the numbers that it was calibrated with.
        about: where it comes from (seed, sources, counts, version of the program): anything that JSON can hold.

    Raises:
        ValueError: the numbers of classes differ.
    """

    classes: tuple[str, ...]
    codebooks: tuple[Codebook, ...]
    calibration: Calibration
    voting: VotingConfig
    about: Mapping[str, Any]

    def __post_init__(self) -> None:
        object.__setattr__(self, "classes", checked_classes(self.classes))
        object.__setattr__(self, "codebooks", tuple(self.codebooks))
        counts = len(self.classes), len(self.codebooks), len(self.calibration.slope)
        if len(set(counts)) != 1 or counts[0] == 0:
            raise ValueError(f"classes, codebooks and calibrations must be as many, but are {counts}")

    def save(self, path: str | Path) -> None:
        """Write a .npz of arrays and one JSON document (see `model_file`), whole or not at all.

        Bins of a descriptor are rounded to 1/255 of its largest one. Saving what was loaded gives the same file again.

        Raises:
            UserError: where the place cannot be written.
        """
        arrays, rows = {}, []
        for number, book in enumerate(self.codebooks):
            largest = np.maximum(book.descriptors.max(axis=1, keepdims=True), 1e-12)
            arrays[f"descriptors_{number}"] = np.round(LEVELS * (book.descriptors / largest)).astype(np.uint8)
            arrays[f"offsets_{number}"] = book.offsets
            arrays[f"sizes_{number}"] = book.sizes
            rows.append({name: getattr(book, name) for name in ("radius", "edge_mean", "edge_std", "depth")})
        document = {
            "schema": SCHEMA,
            "classes": list(self.classes),
            "codebooks": rows,
            "calibration": {name: values.tolist() for name, values in asdict(self.calibration).items()},
            "voting": asdict(self.voting),
            "about": dict(self.about),
        }
        write_document(Path(path), document, arrays)


def load_model(path: str | Path) -> ShapeContextModel:
    """What `ShapeContextModel.save` wrote.

    Raises:
        InputError: for anything else; it says what was found.
    """
    path = Path(path)
    document, arrays = read_document(path, SCHEMA, KIND, REMEDY)
    try:
        voting = document["voting"]
        return ShapeContextModel(
            tuple(document["classes"]),
            tuple(_codebook(row, arrays, number) for number, row in enumerate(document["codebooks"])),
            Calibration(**{name: np.array(values) for name, values in document["calibration"].items()}),
            VotingConfig(**{**voting, "context": Context(voting["context"])}),
            document["about"],
        )
    except KeyError as error:
        raise InputError(path, f"{KIND} ({SCHEMA})", f"no {error.args[0]!r} in it", REMEDY) from None
    except (TypeError, ValueError, AttributeError) as error:
        raise InputError(path, f"{KIND} ({SCHEMA})", str(error), REMEDY) from None


def _codebook(row: Mapping[str, Any], arrays: Mapping[str, np.ndarray], number: int) -> Codebook:
    levels = arrays[f"descriptors_{number}"]
    if levels.dtype != np.uint8:
        raise ValueError(f"descriptors of type {levels.dtype}")
    bins = levels.astype(np.float32)
    total = np.maximum(bins.sum(axis=1, keepdims=True), 1.0)
    return Codebook(bins / total, arrays[f"offsets_{number}"], arrays[f"sizes_{number}"], **row)
