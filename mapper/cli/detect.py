"""`thingmap detect`: a detector's boxes for every frame, in a file to map from later."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .interrupt import stop_on_interrupt
from .progress import FrameProgress
from .sources import DatasetOption, MaxFramesOption, SequenceArgument, StrideOption, skipped_line

if TYPE_CHECKING:
    from ...datasets.frame import Frame
    from ...datasets.sequence import Sequence
    from ...detectors.detections import Detections
    from ...detectors.detector import Detector
    from ..labelling.validation import Validator


def detect(
    sequence: SequenceArgument,
    detector: Annotated[str, typer.Option(metavar="SPEC", help="simulated, onnx:MODEL, ...")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="detections.json to write.")],
    dataset: DatasetOption = None,
    stride: StrideOption = 1,
    max_frames: MaxFramesOption = None,
    validate: Annotated[
        Path | None,
        typer.Option(metavar="OUT", help="Hold boxes against the points of a labelled run."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE if it is there.")] = False,
) -> None:
    """Run a detector over a sequence and keep what it finds.

    `thingmap run --detector recorded:FILE` maps from the file.

    With --validate OUT, the folder of a run of this sequence that `thingmap label` has labelled, a box stays only where
    its class is that of most points in the middle of it; of several on one thing the best stays, and is drawn midway to
    where that thing's points reach. Give the detector a low threshold then.

    Ctrl-C ends after the frame at hand and writes the frames so far.
    """
    from ...datasets.errors import InputError, UserError
    from ...datasets.open import open_sequence
    from ...detectors.recorded import write_detections
    from ...detectors.spec import make_detector
    from ..labelling.validation import Validator
    from ..map.store import OutputFolder

    if output.exists() and not overwrite:
        raise InputError(output, "a new file", "an existing one", "choose another name or add --overwrite")
    frames = open_sequence(sequence, dataset=dataset, stride=stride, max_frames=max_frames)
    call = make_detector(detector, frames)
    validator = None if validate is None else Validator.load(OutputFolder.open(validate))
    if validator is not None and all(validator.pose_at(stamp) is None for stamp in frames.stamps):
        raise UserError(f"{validate}: none of its frames are in {sequence}, by their stamps; give the run of that")
    with stop_on_interrupt() as should_stop, FrameProgress("detecting", len(frames)) as progress:
        job = _Detecting(frames, call, validator, progress, should_stop)
        items = iter(job)
        first = next(items, None)
        if first is None and not job.stopped:
            raise UserError(f"{sequence}: none of the {len(frames)} frames can be used; {skipped_line(job.skipped)}")
        written = 0
        if first is not None:
            written = write_detections(output, first[1].classes, chain([first], items), overwrite=overwrite)
    skipped = skipped_line(job.skipped)
    if skipped:
        typer.echo(skipped, err=True)
    if written:
        typer.echo(f"{job.boxes} boxes in {written} frames; they are in {output}")
        if validate is not None:
            why = f"{job.denied} disagreed with {validate}, {job.doubled} were not the best of a thing"
            typer.echo(f"{job.denied + job.doubled} more were left out: {why}")
        if job.unmapped:
            typer.echo(f"{job.unmapped} frames are not in {validate}: their boxes are as they were found", err=True)
    if job.stopped:
        what = f"the {written} frames before are in {output}" if written else "nothing is written"
        typer.echo(f"interrupted; {what}", err=True)
        raise typer.Exit(130)


class _Detecting:
    """Frame names and their detections, validated where something does that, in order; counts as it goes."""

    def __init__(
        self,
        sequence: Sequence,
        detector: Detector,
        validator: Validator | None,
        progress: FrameProgress,
        should_stop: Callable[[], bool],
    ) -> None:
        self._sequence, self._detector, self._validator = sequence, detector, validator
        self._progress, self._should_stop = progress, should_stop
        self.skipped: dict[str, list[str]] = defaultdict(list)
        self.boxes = 0
        self.denied = self.doubled = 0
        self.unmapped = 0
        self.stopped = False

    def __iter__(self) -> Iterator[tuple[str, Detections]]:
        from ...datasets.frame import BrokenFrame
        from ..read_ahead import ReadAhead

        with ReadAhead(self._sequence) as readings:
            for reading in readings:
                if self._should_stop():
                    self.stopped = True
                    return
                if isinstance(reading.result, BrokenFrame):
                    self.skipped[reading.result.problem.value].append(reading.result.name)
                    continue
                detections = self._validated(reading.result, self._detector(reading.result))
                self.boxes += len(detections)
                self._progress.show(reading.position + 1, f"{self.boxes} boxes")
                yield reading.result.name, detections

    def _validated(self, frame: Frame, detections: Detections) -> Detections:
        if self._validator is None:
            return detections
        T_world_camera = self._validator.pose_at(frame.stamp)
        if T_world_camera is None:
            self.unmapped += 1
            return detections
        validated = self._validator.validate(detections, frame, T_world_camera)
        self.denied += validated.denied
        self.doubled += validated.doubled
        return validated.detections
