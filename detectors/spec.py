"""Detectors by a line of text, as the command line and configuration files name them.

    onnx:PATH             names=FILE confidence=0.1 nms=0.5 max=100 backend=opencv size=640x480 family=yolox-decoded
    hog[:PATH]            confidence=0.1 nms=0.4 max=100 parts=0 merge=0
    proposals             confidence=0.5 max=100 edge=1
    shape-context[:PATH]  confidence=0.5 max=100
    recorded:PATH         format=coco names=FILE label=cabinet images=FILE
    simulated             seed=1 parts=1 max_recall=0.96 background_spots=5 chance_rate=0.12 ...
    none

Options follow a question mark: `onnx:model.onnx?confidence=0.2&backend=opencv`. `OnnxDetector`, `HogDetector`,
`ProposalDetector`, `ShapeContextDetector` and `RecordedDetections` explain them; those of `simulated` are the seed and
the numbers of `SimulatedDetectorConfig`.
`hog` and `shape-context` alone are the shipped models of the synthetic world's things. A path alone is `onnx:` when it
ends in .onnx, `recorded:` when it is a .json file or a folder, and for an .npz what the model in it is for.
"""

from __future__ import annotations

from pathlib import Path

from ..datasets.errors import UserError
from ..datasets.sequence import Sequence
from .detector import Detector
from .kinds import KINDS, MEANING
from .model_file import schema_of


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
    kind = KINDS.get(scheme)
    if kind is None:
        known = ", ".join(kind.usage for kind in KINDS.values())
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
            raise UserError(f"detector {spec!r}: {name}={text} is not {MEANING[parse]}") from None
    return kind.make(path, sequence, options)


def _split(spec: str) -> tuple[str, str, dict[str, str]]:
    """(scheme, path, options as text) of a line."""
    body, _, query = spec.strip().partition("?")
    scheme, colon, path = body.partition(":")
    if (not colon and scheme not in KINDS) or len(scheme) == 1:  # a path alone; one letter is a drive
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
        return "shape-context" if schema_of(Path(path)).startswith("thingmap-shape-context/") else "hog"
    is_recorded = path.lower().endswith(".json") or (path != "" and Path(path).is_dir())
    return "recorded" if is_recorded else path
