"""What training puts out and detection takes: linear templates of classes and of their parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import InputError
from ..checks import checked_classes
from ..detections import Part
from ..model_file import read_document, write_document
from ..platt import probability
from .channels import Channels
from .config import PyramidConfig
from .second_stage.network import WindowNetwork
from .second_stage.window_views import view_size

SCHEMA = "thingmap-hog/1"
KIND = "a HOG model"
REMEDY = "train a model with `thingmap train hog`, or say `hog` alone for the one that is shipped"


@dataclass(frozen=True, slots=True, eq=False)
class HogTemplate:
    """A linear classifier of windows, which answers to one part of the objects of one class.

    score = <weights, features> + scale_weight * log2(scale of the pyramid's level) + bias     (Lai et al. 2012, eq. 2)

    Attributes:
        class_id: index into the model's classes. Several templates of a class and part are alternatives.
        part: what it answers to. The window of a half template covers the half of the whole object's window.
        weights: (rows, columns, C) float32, one for every feature of a window of rows x columns cells.
        scale_weight: on log2 of the level's scale (2 is the image at twice its size).
        bias: added to every score.
        platt: (u, v) of p = 1 / (1 + exp(u score + v)) (eq. 3); u is not positive.
        box: (x0, y0, x1, y1) of the part's true box in the window, as shares of the window's width and height: a window
            is wider or taller than most of its objects, since its aspect is one for all.

    Raises:
        ValueError: a shape or number is not as above.
    """

    class_id: int
    part: Part
    weights: np.ndarray
    scale_weight: float
    bias: float
    platt: tuple[float, float]
    box: tuple[float, float, float, float]

    def __post_init__(self) -> None:
        weights = np.ascontiguousarray(self.weights, dtype=np.float32)
        if weights.ndim != 3 or 0 in weights.shape:
            raise ValueError(f"weights must have shape (rows, columns, C), but got shape {weights.shape}")
        numbers = (self.scale_weight, self.bias, *self.platt, *self.box)
        if not (np.isfinite(weights).all() and np.isfinite(numbers).all()):
            raise ValueError("a template must have finite numbers only")
        if len(self.platt) != 2 or self.platt[0] > 0.0:
            raise ValueError(f"platt must be (u, v) with u <= 0, but got {self.platt}")
        if len(self.box) != 4 or self.box[0] >= self.box[2] or self.box[1] >= self.box[3]:
            raise ValueError(f"box must be (x0, y0, x1, y1) with x0 < x1 and y0 < y1, but got {self.box}")
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "part", Part(self.part))

    def probability(self, score: np.ndarray) -> np.ndarray:
        """Eq. (3) of scores of any shape."""
        return probability(score, *self.platt)


@dataclass(frozen=True, slots=True, eq=False)
class HogModel:
    """Everything that `HogDetector` needs.

    Attributes:
        classes: K names.
        channels: what the weights' last axis counts.
        templates: at least one; any number for each class and part.
        pyramid: the scales at which the model is to be used.
        about: where it comes from (seed, sources, counts, version of the program): anything that JSON can hold.
        second_stage: looks again at the windows that the whole objects' templates propose; None for a model that has
            none. It needs depth.

    Raises:
        ValueError: no template, or one that does not fit the classes or the channels, or a second stage that does not.
    """

    classes: tuple[str, ...]
    channels: Channels
    templates: tuple[HogTemplate, ...]
    pyramid: PyramidConfig
    about: Mapping[str, Any]
    second_stage: WindowNetwork | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "classes", checked_classes(self.classes))
        object.__setattr__(self, "templates", tuple(self.templates))
        if not self.templates:
            raise ValueError("a model must have at least one template")
        for template in self.templates:
            if not 0 <= template.class_id < len(self.classes):
                raise ValueError(
                    f"class_id {template.class_id} of a template is not one of {len(self.classes)} classes"
                )
            if template.weights.shape[2] != self.channels.count:
                found = template.weights.shape[2]
                raise ValueError(f"{self.channels} has {self.channels.count} channels, but a template has {found}")
        self._check_second_stage()

    def _check_second_stage(self) -> None:
        network, classes = self.second_stage, len(self.classes)
        if network is None:
            return
        if not self.channels.use_depth:
            raise ValueError("a second stage needs a model that looks at depth")
        expected = view_size(self.channels.count, classes), classes
        if (network.inputs, network.classes) != expected:
            found = network.inputs, network.classes
            raise ValueError(f"the second stage is for {found} numbers and classes, and not for {expected}")

    def save(self, path: str | Path) -> None:
        """Write a .npz of arrays and one JSON document (see `model_file`), whole or not at all.

        Weights are rounded to 11 bits (float16, after division by the largest of their template): a score moves by less
        than a thousandth of an SVM's margin, and the file halves. Saving what was loaded gives the same file again.

        Raises:
            UserError: where the place cannot be written.
        """
        rows, arrays = [], {}
        for index, t in enumerate(self.templates):
            most = float(np.abs(t.weights).max()) or 1.0
            arrays[_array_name(index)] = (t.weights / np.float32(most)).astype(np.float16)
            numbers = {"scale_weight": t.scale_weight, "bias": t.bias, "largest_weight": most}
            row = {"class_id": int(t.class_id), "part": t.part.name.lower()}
            row |= {name: float(number) for name, number in numbers.items()}
            rows.append(row | {"platt": [float(x) for x in t.platt], "box": [float(x) for x in t.box]})
        document = {
            "schema": SCHEMA,
            "classes": list(self.classes),
            "channels": self.channels.value,
            "templates": rows,
            "pyramid": asdict(self.pyramid),
            "about": dict(self.about),
        }
        if self.second_stage is not None:
            document["second_stage"] = {"layers": len(self.second_stage.weights)}
            arrays |= self.second_stage.arrays()
        write_document(Path(path), document, arrays)


def load_model(path: str | Path) -> HogModel:
    """What `HogModel.save` wrote.

    Raises:
        InputError: for anything else; it says what was found.
    """
    path = Path(path)
    document, arrays = read_document(path, SCHEMA, KIND, REMEDY)
    try:
        return HogModel(
            tuple(document["classes"]),
            Channels(document["channels"]),
            tuple(_template(row, arrays[_array_name(i)]) for i, row in enumerate(document["templates"])),
            PyramidConfig(**document["pyramid"]),
            document["about"],
            _second_stage(document, arrays),
        )
    except KeyError as error:
        raise InputError(path, f"{KIND} ({SCHEMA})", f"no {error.args[0]!r} in it", REMEDY) from None
    except (TypeError, ValueError, AttributeError) as error:
        raise InputError(path, f"{KIND} ({SCHEMA})", str(error), REMEDY) from None


def shipped_model() -> Path:
    """File of the model of the synthetic world's things, which comes with the package."""
    return Path(__file__).parent / "models" / "synthetic.npz"


def _array_name(index: int) -> str:
    return f"weights_{index}"


def _second_stage(document: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> WindowNetwork | None:
    if "second_stage" not in document:
        return None
    return WindowNetwork.of_arrays(arrays, int(document["second_stage"]["layers"]))


def _template(row: Mapping[str, Any], weights: np.ndarray) -> HogTemplate:
    if weights.dtype != np.float16:
        raise ValueError(f"weights of type {weights.dtype}")
    u, v = row["platt"]
    x0, y0, x1, y1 = row["box"]
    return HogTemplate(
        int(row["class_id"]),
        Part[row["part"].upper()],
        weights.astype(np.float32) * np.float32(row["largest_weight"]),
        float(row["scale_weight"]),
        float(row["bias"]),
        (float(u), float(v)),
        (float(x0), float(y0), float(x1), float(y1)),
    )
