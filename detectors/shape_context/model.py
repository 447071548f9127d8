"""What training puts out and detection takes: a codebook of every class and of what is none, and what scores mean."""

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
from .config import LENGTH, Context, VotingConfig
from .scoring import Rivals

SCHEMA = "thingmap-shape-context/1"
KIND = "a shape-context model"
REMEDY = "train a model with `thingmap train shape-context`, or say `shape-context` alone for the one that is shipped"
LEVELS = 255  # of a descriptor's bins in the file


@dataclass(frozen=True, slots=True, eq=False)
class ShapeContextModel:
    """Everything that `ShapeContextDetector` needs.

    Attributes:
        classes: C names.
        codebooks: C of them.
        rivals: (radius, (B, LENGTH) float32 descriptors) of things that are none of the classes, one for each radius of
            the codebooks; none at all where there was nothing to learn them from.
        calibration: of the classes' scores.
        voting: the numbers that it was calibrated with.
        about: where it comes from (seed, sources, counts, version of the program): anything that JSON can hold.

    Raises:
        ValueError: the numbers of classes differ.
    """

    classes: tuple[str, ...]
    codebooks: tuple[Codebook, ...]
    rivals: Rivals
    calibration: Calibration
    voting: VotingConfig
    about: Mapping[str, Any]

    def __post_init__(self) -> None:
        object.__setattr__(self, "classes", checked_classes(self.classes))
        object.__setattr__(self, "codebooks", tuple(self.codebooks))
        counts = len(self.classes), len(self.codebooks), len(self.calibration.offset)
        if len(set(counts)) != 1 or counts[0] == 0:
            raise ValueError(f"classes, codebooks and calibrations must be as many, but are {counts}")
        radii = {book.radius for book in self.codebooks}
        if self.rivals and set(self.rivals) != radii:
            raise ValueError(
                f"rivals must be of the codebooks' radii {sorted(radii)}, but are of {sorted(self.rivals)}"
            )

    def save(self, path: str | Path) -> None:
        """Write a .npz of arrays and one JSON document (see `model_file`), whole or not at all.

        Bins of a descriptor are rounded to 1/255 of its largest one. Saving what was loaded gives the same file again.

        Raises:
            UserError: where the place cannot be written.
        """
        arrays, rows = {}, []
        for number, book in enumerate(self.codebooks):
            arrays[f"descriptors_{number}"] = _levels(book.descriptors)
            arrays[f"offsets_{number}"] = book.offsets
            arrays[f"sizes_{number}"] = book.sizes
            rows.append({name: getattr(book, name) for name in ("radius", "edge_mean", "edge_std", "depth")})
        arrays |= {f"rivals_{k}": _levels(bins) for k, bins in enumerate(self.rivals.values())}
        document = {
            "schema": SCHEMA,
            "classes": list(self.classes),
            "codebooks": rows,
            "rivals": [float(radius) for radius in self.rivals],
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
            {radius: _shares(arrays[f"rivals_{k}"]) for k, radius in enumerate(document["rivals"])},
            Calibration(**{name: np.array(values) for name, values in document["calibration"].items()}),
            VotingConfig(**{**voting, "context": Context(voting["context"])}),
            document["about"],
        )
    except KeyError as error:
        raise InputError(path, f"{KIND} ({SCHEMA})", f"no {error.args[0]!r} in it", REMEDY) from None
    except (TypeError, ValueError, AttributeError) as error:
        raise InputError(path, f"{KIND} ({SCHEMA})", str(error), REMEDY) from None


def shipped_model() -> Path:
    """File of the model of the synthetic world's things, which comes with the package."""
    return Path(__file__).parent / "models" / "synthetic.npz"


def _codebook(row: Mapping[str, Any], arrays: Mapping[str, np.ndarray], number: int) -> Codebook:
    bins = _shares(arrays[f"descriptors_{number}"])
    return Codebook(bins, arrays[f"offsets_{number}"], arrays[f"sizes_{number}"], **row)


def _levels(descriptors: np.ndarray) -> np.ndarray:
    """(M, LENGTH) uint8, bins in units of 1 / `LEVELS` of the row's largest."""
    largest = np.maximum(descriptors.max(axis=1, keepdims=True), 1e-12)
    return np.round(LEVELS * (descriptors / largest)).astype(np.uint8)


def _shares(levels: np.ndarray) -> np.ndarray:
    """(M, LENGTH) float32 descriptors, rows that add up to 1, of what `_levels` gave."""
    if levels.dtype != np.uint8 or levels.ndim != 2 or levels.shape[1] != LENGTH:
        raise ValueError(f"descriptors of type {levels.dtype} and shape {levels.shape}")
    bins = levels.astype(np.float32)
    return bins / np.maximum(bins.sum(axis=1, keepdims=True), 1.0)
