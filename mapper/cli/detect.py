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
    from ...datasets.sequence import Sequence
    from ...detectors.detections import Detections
    from ...detectors.detector import Detector


def detect(
    sequence: SequenceArgument,
    detector: Annotated[str, typer.Option(metavar="SPEC", help="simulated, onnx:MODEL, ...")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="detections.json to write.")],
    dataset: DatasetOption = None,
    stride: StrideOption = 1,
    max_frames: MaxFramesOption = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE if it is there.")] = False,
) -> None:
    """Run a detector over a sequence and keep what it finds.

    `thingmap run --detector recorded:FILE` maps from the file.

    Ctrl-C ends after the frame at hand and writes the frames so far.
    """
    from ...datasets.errors import InputError, UserError
    from ...datasets.open import open_sequence
    from ...detectors.recorded import write_detections
    from ...detectors.spec import make_detector

    if output.exists() and not overwrite:
        raise InputError(output, "a new file", "an existing one", "choose another name or add --overwrite")
    frames = open_sequence(sequence, dataset=dataset, stride=stride, max_frames=max_frames)
    call = make_detector(detector, frames)
    with stop_on_interrupt() as should_stop, FrameProgress("detecting", len(frames)) as progress:
        job = _Detecting(frames, call, progress, should_stop)
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
    if job.stopped:
        what = f"the {written} frames before are in {output}" if written else "nothing is written"
        typer.echo(f"interrupted; {what}", err=True)
        raise typer.Exit(130)


class _Detecting:
    """Frame names and their detections, in order; counts as it goes."""

    def __init__(
        self, sequence: Sequence, detector: Detector, progress: FrameProgress, should_stop: Callable[[], bool]
    ) -> None:
        self._sequence, self._detector = sequence, detector
        self._progress, self._should_stop = progress, should_stop
        self.skipped: dict[str, list[str]] = defaultdict(list)
        self.boxes = 0
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
                detections = self._detector(reading.result)
                self.boxes += len(detections)
                self._progress.show(reading.position + 1, f"{self.boxes} boxes")
                yield reading.result.name, detections
