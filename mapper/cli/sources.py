"""What commands that read a sequence have in common: its options, and the detector that fits it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ...datasets.sequence import Sequence
    from ..run_report import RunReport

SequenceArgument = Annotated[
    str, typer.Argument(metavar="SEQUENCE", help="Folder of a sequence, bag of ROS, sample:tabletop, or synth:PRESET.")
]
DatasetOption = Annotated[str | None, typer.Option(metavar="NAME", help="Loader; told from the folder by default.")]
StrideOption = Annotated[int, typer.Option(min=1, metavar="N", help="Take every Nth frame.")]
MaxFramesOption = Annotated[int | None, typer.Option(min=1, metavar="N", help="Stop after N frames.")]
NAMED = 5  # skipped frames named on the screen for each problem; the report names all


def choose_detector(spec: str | None, source: str, sequence: Sequence) -> str:
    """The detector asked for, or the one that the sequence brings: its truth, or `detections.json` in its folder.

    Raises:
        UserError: there is neither.
    """
    from ...datasets.errors import UserError
    from ...datasets.path_options import split_options
    from ...datasets.truth import HasTruth

    if spec is not None:
        return spec
    if isinstance(sequence, HasTruth):
        return "simulated"
    recorded = split_options(source)[0] / "detections.json"
    if recorded.is_file():
        return f"recorded:{recorded}"
    raise UserError(
        f"{source}: no detector: give --detector (onnx:MODEL for a network, proposals for whatever stands on "
        "tables and floors, recorded:FILE for boxes you have), "
        "or put a detections.json into the sequence's folder"
    )


def missing_line(spec: str, detector: object, report: RunReport) -> str | None:
    """One line that names the keyframes that a recording lacks; None for a detector that is no recording.

    Raises:
        UserError: it lacks all of a whole run, so it belongs to another sequence.
    """
    from ...datasets.errors import UserError

    missing: tuple[str, ...] = getattr(detector, "missing", ())
    if not missing:
        return None
    if len(missing) >= report.keyframes and report.stopped is None:
        raise UserError(
            f"{spec}: none of the {report.keyframes} keyframes ({_named(missing)}) is in it; "
            "give the detections of this sequence, under the names of its frames"
        )
    return f"{spec} has nothing for {len(missing)} keyframes ({_named(missing)})"


def skipped_line(skipped: Mapping[str, Iterable[str]]) -> str | None:
    """One line that counts and names the frames that were not used; None where all were."""
    parts = []
    for problem, frames in skipped.items():
        names = list(frames)
        parts.append(f"{len(names)} with {problem} ({_named(names)})")
    return "skipped frames: " + "; ".join(parts) if parts else None


def _named(names: list[str] | tuple[str, ...]) -> str:
    return ", ".join(names[:NAMED]) + (", ..." if len(names) > NAMED else "")
