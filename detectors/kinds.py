"""The kinds of detectors that a line of text can name, and how each is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any, NamedTuple

from ..datasets.errors import UserError
from ..datasets.sequence import Sequence
from ..datasets.truth import HasTruth
from .detector import Detector, find_nothing
from .simulated_config import SimulatedDetectorConfig


class Kind(NamedTuple):
    """One kind of detector.

    Attributes:
        usage: how it is written.
        needs_path: whether there has to be a path or must not be one; None where there may be.
        make: the detector from path, sequence and options.
        options: for each name the keyword, and how to read its text.
    """

    usage: str
    needs_path: bool | None
    make: Callable[[str, Sequence | None, dict[str, Any]], Detector]
    options: dict[str, tuple[str, Callable[[str], Any]]]


def _make_onnx(path: str, sequence: Sequence | None, options: dict[str, Any]) -> Detector:
    from .onnx import OnnxDetector

    return OnnxDetector(path, **options)


def _make_hog(path: str, sequence: Sequence | None, options: dict[str, Any]) -> Detector:
    from .hog.detector import HogDetector

    return HogDetector(path or None, **options)


def _make_proposals(path: str, sequence: Sequence | None, options: dict[str, Any]) -> Detector:
    from .proposals.detector import ProposalDetector

    return ProposalDetector(**options)


def _make_shape_context(path: str, sequence: Sequence | None, options: dict[str, Any]) -> Detector:
    from .shape_context.detector import ShapeContextDetector

    return ShapeContextDetector(path or None, **options)


def _make_recorded(path: str, sequence: Sequence | None, options: dict[str, Any]) -> Detector:
    from ..datasets.views import Subset
    from .recorded import MatchedBy, RecordedDetections

    detector = RecordedDetections(path, **options)
    if detector.matched_by is MatchedBy.INDEX and isinstance(sequence, Subset) and sequence.indices.step != 1:
        reason = "its image ids count all frames, but only some are used"
        raise UserError(f"{path}: {reason}; use every frame, or list the images with images=FILE")
    if sequence is not None:
        detector.check_against(sequence.names)
    return detector


def _make_simulated(path: str, sequence: Sequence | None, options: dict[str, Any]) -> Detector:
    if not isinstance(sequence, HasTruth):
        raise UserError("detector simulated needs a synthetic sequence, whose objects are known")
    from .simulated import SimulatedDetector

    seed = options.pop("seed", 0)
    return SimulatedDetector(sequence, SimulatedDetectorConfig(**options), seed)


def _make_none(path: str, sequence: Sequence | None, options: dict[str, Any]) -> Detector:
    return find_nothing


def _size(text: str) -> tuple[int, int]:
    """`640x480`, or `640` for a square."""
    width, _, height = text.partition("x")
    return int(width), int(height or width)


def _switch(text: str) -> bool:
    """`1` or `0`."""
    if text not in ("0", "1"):
        raise ValueError(text)
    return text == "1"


_NUMBERS = {f.name: f.default for f in fields(SimulatedDetectorConfig) if isinstance(f.default, int | float)}
MEANING = {int: "a whole number", float: "a number", _switch: "0 or 1", _size: "a size such as 640x480"}


_BOXES_KEPT = {"confidence": ("confidence", float), "nms": ("nms_iou", float), "max": ("max_detections", int)}
KINDS = {
    "onnx": Kind(
        "onnx:PATH",
        True,
        _make_onnx,
        {
            "names": ("classes", str),
            **_BOXES_KEPT,
            "backend": ("backend", str),
            "size": ("input_size", _size),
            "family": ("family", str),
        },
    ),
    "hog": Kind(
        "hog[:PATH]",
        None,
        _make_hog,
        {**_BOXES_KEPT, "parts": ("parts", _switch), "merge": ("merge", _switch)},
    ),
    "proposals": Kind(
        "proposals",
        False,
        _make_proposals,
        {"confidence": ("confidence", float), "max": ("max_detections", int), "edge": ("edge", _switch)},
    ),
    "shape-context": Kind(
        "shape-context[:PATH]",
        None,
        _make_shape_context,
        {"confidence": ("confidence", float), "max": ("max_detections", int)},
    ),
    "recorded": Kind(
        "recorded:PATH",
        True,
        _make_recorded,
        {
            "format": ("format", str),
            "names": ("names", str),
            "label": ("label", str),
            "images": ("images", str),
        },
    ),
    "simulated": Kind(
        "simulated",
        False,
        _make_simulated,
        {
            "seed": ("seed", int),
            **{name: (name, _switch if isinstance(value, bool) else type(value)) for name, value in _NUMBERS.items()},
        },
    ),
    "none": Kind("none", False, _make_none, {}),
}
