"""Detections that were made before, as a detector."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...datasets.errors import InputError, UserError
from ...datasets.frame import Frame
from ..detections import Detections
from .formats import RecordedFormat, read_recording
from .recording import ReadOptions


class RecordedDetections:
    """Detections from a file or folder, found by the frame's name.

    Names agree without folders, image suffix and `.color`: `rgb/frame-000000.color.png` is `frame-000000`. A frame
    that the file lacks has no detections and is counted in `missing`.

    Args:
        path: a JSON file or a folder of text labels.
        format: `thingmap`, `coco`, `oaslam`, `yolo` or `boxes`; None takes it from the content (`boxes` has to be
            asked for).
        names: class names by number, or a file of them, for `oaslam` and `yolo`; COCO's 80 otherwise.
        label: the one class of `boxes`.
        images: COCO file that lists the images and categories of `coco` results.

    Attributes:
        classes: names, the same for every frame.
        format: the format that was read.
        matched_by: what frames are found by; the name, unless the format knows only numbers.

    Raises:
        InputError: for a missing path or a content that is not as its format says.
        UserError: for an unknown format, or an option that the format has no use for.
    """

    def __init__(
        self,
        path: str | Path,
        format: RecordedFormat | str | None = None,
        *,
        names: tuple[str, ...] | Path | str | None = None,
        label: str | None = None,
        images: Path | str | None = None,
    ) -> None:
        try:
            wanted = None if format is None else RecordedFormat(format)
        except ValueError:
            known = ", ".join(member.value for member in RecordedFormat)
            raise UserError(f"format must be one of {known}, but is {format!r}") from None
        self.path = Path(path)
        self.format, self._recording = read_recording(self.path, wanted, ReadOptions(names, label, images))
        self.classes, self.matched_by = self._recording.classes, self._recording.matched_by
        self._missing: dict[str, None] = {}
        self._dropped: dict[str, int] = {}

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the frames asked for so far that the file lacks, in order."""
        return tuple(self._missing)

    @property
    def dropped(self) -> int:
        """Boxes left out so far since they have no area inside the image."""
        return sum(self._dropped.values())

    def check_against(self, names: Iterable[str]) -> None:
        """Make sure that the file belongs to a sequence, of which these are the frame names in order.

        Raises:
            InputError: where no frame of the file is among them.
        """
        recorded = self._recording.frames
        names = list(names)
        if any(self.matched_by.key(i, name) in recorded for i, name in enumerate(names)):
            return
        expected = f"detections of frames such as {names[0]!r}" if names else "detections of an empty sequence"
        found = f"{len(recorded)} frames" + (f" such as {next(iter(recorded))!r}" if recorded else "")
        remedy = "give the detections of this sequence, with its frame names"
        raise InputError(self.path, expected, f"{found}, by {self.matched_by.value}", remedy)

    def __call__(self, frame: Frame, /) -> Detections:
        """The frame's detections, cut to the image.

        Raises:
            InputError: for detections made in images of another size.
        """
        recording, key = self._recording, self.matched_by.key(frame.index, frame.name)
        found = recording.frames.get(key)
        if found is None:
            self._missing[frame.name] = None
            return Detections.empty(self.classes)
        width, height = frame.intrinsics.width, frame.intrinsics.height
        masks = recording.masks.get(key)
        recorded_size = recording.sizes.get(key) or (masks and masks.size[::-1])
        if recorded_size and recorded_size != (width, height):
            expected = f"detections in images of {width}x{height} ({frame.name})"
            size = f"{recorded_size[0]}x{recorded_size[1]}"
            raise InputError(self.path, expected, size, "detect in images of the sequence's own size")
        if masks:
            found = replace(found, mask=masks.decode())
        if recording.normalised:
            found = replace(found, xyxy=found.xyxy * np.array([width, height, width, height]))
        inside = found.clip(width, height)
        self._dropped[frame.name] = len(found) - len(inside)
        return inside
