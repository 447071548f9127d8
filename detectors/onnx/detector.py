"""A YOLO-like ONNX network as a detector with full score vectors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import TypeVar

import numpy as np

from ...datasets.errors import InputError, UserError
from ...datasets.frame import Frame
from ..detections import Detections
from ..letterbox import Letterbox
from ..selection import check_selection
from .model import Model, load_model
from .network import Backend
from .outputs import OutputFamily, decode
from .suppression import suppress


@dataclass(frozen=True, slots=True, eq=False)
class OnnxDetector:
    """YOLOX, YOLOv5, YOLOv8 and networks with their outputs. Loads the network and runs it once when made.

    Every detection carries the scores of all classes. The same frame gives the same detections.

    Attributes:
        path: the ONNX file.
        classes: K names, or a file of them (`read_class_names`). None takes the names stored in the model, else
            COCO's 80. Afterwards it holds the names.
        confidence: least score of the best class; low, since the mapper weighs evidence instead of trusting it.
        nms_iou: intersection over union above which the lesser of two boxes goes, whatever their classes.
        max_detections: most boxes kept per frame, the best ones.
        backend: library that runs the network.
        input_size: (width, height) in pixels, multiples of 32, for models that leave it open; 640 x 640 if None.
        family: layout of the output; None takes it from the output's shape.

    Raises:
        InputError: for a missing or broken file, an output that is not understood, or a class count that differs
            from the number of names.
        UserError: for an option out of range, or onnxruntime asked for and not installed.
    """

    path: Path | str
    classes: Sequence[str] | Path | str | None = None
    confidence: float = 0.1
    nms_iou: float = 0.5
    max_detections: int = 100
    backend: Backend | str = Backend.AUTO
    input_size: tuple[int, int] | None = None
    family: OutputFamily | str | None = None
    _model: Model = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_selection(self.confidence, self.max_detections, self.nms_iou)
        backend = _member(Backend, "backend", self.backend)
        family = None if self.family is None else _member(OutputFamily, "family", self.family)
        model = load_model(Path(self.path), self.classes, backend, self.input_size, family)
        for name, value in (("_model", model), ("classes", model.classes)):
            object.__setattr__(self, name, value)

    def __call__(self, frame: Frame, /) -> Detections:
        """Detections of a frame's colour image, best first.

        Raises:
            InputError: where the network puts out scores above 1.
        """
        model = self._model
        height, width = frame.color.shape[:2]
        letterbox = Letterbox.fit((width, height), model.size, centred=not model.family.is_yolox)
        xyxy, scores = decode(model(letterbox.image(frame.color)), model.family, *model.size)

        best = scores.max(axis=1)
        found = np.flatnonzero((best >= self.confidence) & np.isfinite(xyxy).all(axis=1))
        # Half-precision networks overshoot 1 a little; logits overshoot it a lot.
        if len(found) and best[found].max() > 1.01:
            most = f"up to {best[found].max():.3g}"
            raise InputError(model.path, "scores in [0, 1]", most, "export the network with its final sigmoid")
        found = found[suppress(xyxy[found], best[found], self.nms_iou, self.max_detections)]
        boxes = letterbox.to_source(xyxy[found])
        return Detections(model.classes, boxes, scores[found].clip(0.0, 1.0)).clip(width, height)


_Choice = TypeVar("_Choice", bound=Enum)


def _member(kind: type[_Choice], option: str, value: _Choice | str) -> _Choice:
    try:
        return kind(value)
    except ValueError:
        known = ", ".join(str(member.value) for member in kind)
        raise UserError(f"{option} must be one of {known}, but is {value!r}") from None
