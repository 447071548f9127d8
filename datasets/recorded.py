"""A recorded sequence: image files with a camera, stamps and, where known, poses. All loaders return one."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .errors import InputError
from .frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from .images import DepthUnit, FrameFiles, read_frame_images
from .registration import DepthRegistration


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedSequence:
    """Implements `datasets.sequence.Sequence` over image files, which are read only when a frame is asked for.

    `for frame in sequence` ends at the first broken frame, as any generator does: use `usable_frames` to go on, or
    index the frames yourself.

    Attributes:
        path: folder the sequence was opened from; named in errors.
        name: shown to people and written to `map.json`.
        files: N frames' image files.
        intrinsics: shared by all frames, colour and depth.
        depth_unit: what the numbers in the depth images mean.
        stamps: (N,) seconds.
        poses: (N, 4, 4) `T_world_camera`, NaN where a frame has none; None without ground truth.
        gravity: (3,) unit vector down in the dataset's world axes, or None.
        specific_force: (N, 3) accelerometer reading in camera axes, m/s^2, NaN where a frame has none; or None.
        registration: where the depth images are the depth camera's own; frames are then the colour camera's, and the
            poses given are those of the colour camera too.
        pose_problems: why a frame that should have a pose has none; such a frame is broken. A frame without a pose
            that is not listed here is usable, its `T_world_camera` is None.

    Raises:
        InputError: there is no frame, or not one of the image files exists.
    """

    path: Path
    name: str
    files: tuple[FrameFiles, ...]
    intrinsics: Intrinsics
    depth_unit: DepthUnit
    stamps: np.ndarray
    poses: np.ndarray | None = None
    gravity: np.ndarray | None = None
    specific_force: np.ndarray | None = None
    registration: DepthRegistration | None = None
    pose_problems: Mapping[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not any(f.color.is_file() and f.depth.is_file() for f in self.files):
            found = f"none of the {len(self.files)} frames has both files" if len(self.files) else "no frame"
            example = f" (first missing: {self._first_missing()})" if len(self.files) else ""
            raise InputError(self.path, "colour and depth images", found + example, "check the folder is complete")

    def __len__(self) -> int:
        return len(self.files)

    @property
    def names(self) -> tuple[str, ...]:
        """What the dataset calls the frames, in order."""
        return tuple(f.name for f in self.files)

    def __getitem__(self, index: int) -> Frame:
        """The frame at `index` (negative counts from the end).

        Raises:
            BrokenFrame: an image or the pose cannot be used; it says which and why.
            IndexError: there is no such frame.
        """
        i = range(len(self.files))[index]
        files = self.files[i]
        if i in self.pose_problems:
            raise BrokenFrame(files.name, FrameProblem.MISSING_POSE, self.pose_problems[i])
        color, depth = read_frame_images(files, self.depth_unit, self.intrinsics)
        if self.registration is not None:
            depth = self.registration.register(depth)
        return Frame(
            index=i,
            name=files.name,
            stamp=float(self.stamps[i]),
            color=color,
            depth=depth,
            intrinsics=self.intrinsics,
            T_world_camera=_row(self.poses, i),
            specific_force=_row(self.specific_force, i),
        )

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))

    def _first_missing(self) -> Path:
        first = self.files[0]
        return first.depth if first.color.is_file() else first.color


def natural_key(name: str) -> list[tuple[bool, int, str]]:
    """Sort key that orders `frame_2` before `frame_10`."""
    return [(not part.isdecimal(), int(part) if part.isdecimal() else 0, part) for part in re.split(r"(\d+)", name)]


def _row(values: np.ndarray | None, i: int) -> np.ndarray | None:
    if values is None or np.isnan(values[i]).any():
        return None
    return values[i].copy()
