"""Detectors by a line of text, as the command line and configuration files name them.

    onnx:PATH       names=FILE confidence=0.1 nms=0.5 max=100 backend=opencv size=640x480 family=yolox-decoded
    hog[:PATH]      confidence=0.1 nms=0.4 max=100 parts=0 merge=0
    proposals       confidence=0.5 max=100 edge=1
    recorded:PATH   format=coco names=FILE label=cabinet images=FILE
    simulated       seed=1 parts=1 max_recall=0.96 background_spots=5 chance_rate=0.12 ...
    none

Options follow a question mark: `onnx:model.onnx?confidence=0.2&backend=opencv`. `OnnxDetector`, `HogDetector`,
`ProposalDetector` and `RecordedDetections` explain them; those of `simulated` are the seed and the numbers of
`SimulatedDetectorConfig`.
`hog` alone is the shipped model of the synthetic world's things. A path alone is `onnx:` when it ends in .onnx, `hog:`
when it ends in .npz, and `recorded:` when it is a .json file or a folder.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

from ..datasets.errors import UserError
from ..datasets.sequence import Sequence
from ..datasets.truth import HasTruth
from .detector import Detector, find_nothing
from .simulated_config import SimulatedDetectorConfig


def make_detector(spec: str, sequence: Sequence | None = None) -> Detector:
    """The detector that a line of text describes (see the module).

    Args:
        spec: the line.
        sequence: what it will run on. `simulated` needs it; `recorded` makes sure that its frames are the
            sequence's.

    Raises:
        UserError: for an unknown kind of detector or option, or a value that is not of the option's type.
        InputError: where the detector's file is not what it should be.
    """
    scheme, path, given = _split(spec)
    kind = _KINDS.get(scheme)
    if kind is None:
        known = ", ".join(kind.usage for kind in _KINDS.values())
        raise UserError(f"detector {spec!r}: there is no {scheme!r}; there are {known}")
    if kind.needs_path is not None and bool(path) is not kind.needs_path:
        raise UserError(f"detector {spec!r}: {'give' if kind.needs_path else 'there is no'} path, as in {kind.usage}")
    options = {}
    for name, text in given.items():
        if name not in kind.options:
            known = ", ".join(kind.options) or "none"
            raise UserError(f"detector {spec!r}: there is no option {name!r}; {scheme} has {known}")
        keyword, parse = kind.options[name]
        try:
            options[keyword] = parse(text)
        except ValueError:
            raise UserError(f"detector {spec!r}: {name}={text} is not {_MEANING[parse]}") from None
    return kind.make(path, sequence, options)


def _split(spec: str) -> tuple[str, str, dict[str, str]]:
    """(scheme, path, options as text) of a line."""
    body, _, query = spec.strip().partition("?")
    scheme, colon, path = body.partition(":")
    if (not colon and scheme not in _KINDS) or len(scheme) == 1:  # a path alone; one letter is a drive
        scheme, path = _scheme_of(body), body
    options: dict[str, str] = {}
    for pair in filter(None, query.split("&")):
        name, equals, text = pair.partition("=")
        if not equals or name in options:
            raise UserError(f"detector {spec!r}: options are name=value, each once, with & between them; got {pair!r}")
        options[name] = text
    return scheme, path, options


def _scheme_of(path: str) -> str:
    """The kind of detector of a path alone; the path itself, which is none, where it shows none."""
    if path.lower().endswith(".onnx"):
        return "onnx"
    if path.lower().endswith(".npz"):
        return "hog"
    is_recorded = path.lower().endswith(".json") or (path != "" and Path(path).is_dir())
    return "recorded" if is_recorded else path


def _make_onnx(path: str, sequence: Sequence | None, options: dict[str, Any]) -> Detector:
    from .onnx import OnnxDetector

    return OnnxDetector(path, **options)


def _make_hog(path: str, sequence: Sequence | None, options: dict[str, Any]) -> Detector:
    from .hog.detector import HogDetector

    return HogDetector(path or None, **options)


def _make_proposals(path: str, sequence: Sequence | None, options: dict[str, Any]) -> Detector:
    from .proposals.detector import ProposalDetector

    return ProposalDetector(**options)


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
_MEANING = {int: "a whole number", float: "a number", _switch: "0 or 1", _size: "a size such as 640x480"}


class _Kind(NamedTuple):
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


_BOXES_KEPT = {"confidence": ("confidence", float), "nms": ("nms_iou", float), "max": ("max_detections", int)}
_KINDS = {
    "onnx": _Kind(
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
    "hog": _Kind(
        "hog[:PATH]",
        None,
        _make_hog,
        {**_BOXES_KEPT, "parts": ("parts", _switch), "merge": ("merge", _switch)},
    ),
    "proposals": _Kind(
        "proposals",
        False,
        _make_proposals,
        {"confidence": ("confidence", float), "max": ("max_detections", int), "edge": ("edge", _switch)},
    ),
    "recorded": _Kind(
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
    "simulated": _Kind(
        "simulated",
        False,
        _make_simulated,
        {
            "seed": ("seed", int),
            **{name: (name, _switch if isinstance(value, bool) else type(value)) for name, value in _NUMBERS.items()},
        },
    ),
    "none": _Kind("none", False, _make_none, {}),
}
