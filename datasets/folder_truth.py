"""A plain folder whose truth was written beside its images (see `truth_files`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InputError
from .recorded import RecordedSequence
from .truth import FrameTruth, PointTruth, TrueObject
from .truth_files import REMEDY, TruthPaths, read_record
from .truth_tables import FrameTable, read_cloud, read_frames, read_instances


@dataclass(frozen=True, eq=False, kw_only=True)
class FolderWithTruth(RecordedSequence):
    """A recorded sequence that fulfils `HasTruth`, `HasClutter` and `HasInstances`.

    Attributes:
        objects: things of `classes`.
        classes: of the objects.
        clutter: things of no class; their ids go on from the objects'.
        up: (3,) unit vector in world axes.
        source: what the sequence was rendered from.
        configuration: of the renderer, exactly.
        truth_paths: where the parts of the truth lie.
        table: what can be seen in the frames.
    """

    objects: tuple[TrueObject, ...]
    classes: tuple[str, ...]
    clutter: tuple[TrueObject, ...]
    up: np.ndarray
    source: str
    configuration: Mapping[str, Any]
    truth_paths: TruthPaths
    table: FrameTable

    def truth(self, index: int) -> FrameTruth:
        """What can be seen of every object in a frame.

        Raises:
            IndexError: there is no such frame.
        """
        return self.table.frame(range(len(self))[index])

    def instances(self, index: int) -> np.ndarray:
        """(H, W) int32: `id` of the object or clutter that every pixel shows, -1 for the room.

        Raises:
            IndexError: there is no such frame.
            InputError: its instance image is missing or damaged.
        """
        image = self.truth_paths.instance_image(range(len(self))[index])
        return read_instances(image, (self.intrinsics.height, self.intrinsics.width), self._ids)

    @property
    def _ids(self) -> set[int]:
        return {thing.id for thing in (*self.objects, *self.clutter)}


class FolderWithCloud(FolderWithTruth):
    """A folder whose truth has a labelled cloud: fulfils `HasPointTruth` too."""

    def point_truth(self) -> PointTruth:
        """The labelled cloud, world of the poses.

        Raises:
            InputError: the file is missing or damaged.
        """
        return read_cloud(self.truth_paths.cloud, len(self.classes), self._ids)


def with_truth(sequence: RecordedSequence, folder: Path) -> FolderWithTruth:
    """The sequence with the truth in `folder`; stamps become the truth's, which no rate has rounded.

    Raises:
        InputError: a file of the truth is missing or damaged, or its frames are not the sequence's. Instance images
            and the cloud are large: they are looked for here, and read when they are asked for.
    """
    paths = TruthPaths(folder)
    record = read_record(paths.record)
    if record.names != sequence.names:
        raise InputError(folder.parent, *_frames_that_differ(record.names, sequence.names), REMEDY)
    for path, wanted in ((paths.instances, True), (paths.cloud, record.has_cloud)):
        if wanted and not path.exists():
            raise InputError(path, "the rest of the truth in truth.json", "no such file or folder", REMEDY)
    ids = {thing.id for thing in (*record.objects, *record.clutter)}
    table = read_frames(paths.frames, len(record.names), ids)
    recorded: dict[str, Any] = {field.name: getattr(sequence, field.name) for field in fields(RecordedSequence)}
    recorded["stamps"] = table.stamps
    return (FolderWithCloud if record.has_cloud else FolderWithTruth)(
        **recorded,
        objects=record.objects,
        classes=record.classes,
        clutter=record.clutter,
        up=record.up,
        source=record.source,
        configuration=record.configuration,
        truth_paths=paths,
        table=table,
    )


def _frames_that_differ(of_truth: tuple[str, ...], of_images: tuple[str, ...]) -> tuple[str, str]:
    """What was expected and what was found."""
    expected, found = f"the {len(of_truth)} frames of truth/truth.json", f"{len(of_images)} frames"
    if lacking := sorted(set(of_truth) - set(of_images)):
        return expected, f"{found} without {lacking[0]}"
    strange = sorted(set(of_images) - set(of_truth))
    return expected, f"{found} with {strange[0]} besides" if strange else f"{found} in another order"
