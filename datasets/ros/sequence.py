"""Frames of a bag, read from disk when they are asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from .bag import NANO, BadMessage, Bag
from .camera import BagCamera
from .images import decode_color, decode_depth
from .topics import ChosenTopics


@dataclass(frozen=True, slots=True)
class Unpaired:
    """Images without a partner, which are no frames.

    Attributes:
        color: colour images without depth near their stamp.
        depth: depth images without colour near their stamp.
    """

    color: int
    depth: int


@dataclass(frozen=True, eq=False, kw_only=True)
class BagSequence:
    """Implements `datasets.sequence.Sequence` over the messages of a bag.

    `for frame in sequence` ends at the first broken frame: use `usable_frames` to go on.

    Attributes:
        bag: the open bag.
        topics: those that the frames come from.
        name: shown to people and written to `map.json`.
        camera: of all frames.
        color: (N, 2) int64, header stamp and time of recording of each frame's colour image, nanoseconds.
        depth: (N, 2), the same of its depth image.
        unpaired: how many images of either topic are no frames.
        poses: (N, 4, 4) `T_world_camera`, NaN where a frame has none; None where none were asked for.
        specific_force: (N, 3) accelerometer reading in camera axes, m/s^2, NaN where a frame has none; or None.
    """

    bag: Bag
    topics: ChosenTopics
    name: str
    camera: BagCamera
    color: np.ndarray
    depth: np.ndarray
    unpaired: Unpaired
    poses: np.ndarray | None = None
    specific_force: np.ndarray | None = None

    @property
    def path(self) -> Path:
        """File or folder of the bag."""
        return self.bag.path

    @property
    def intrinsics(self) -> Intrinsics:
        """Of colour and depth."""
        return self.camera.intrinsics

    @property
    def names(self) -> tuple[str, ...]:
        """The stamps of the colour images in seconds, with all nine digits."""
        return tuple(f"{stamp // NANO}.{stamp % NANO:09d}" for stamp in self.color[:, 0].tolist())

    @property
    def stamps(self) -> np.ndarray:
        """(N,) seconds, of the colour images' headers."""
        return self.color[:, 0] / NANO

    @property
    def gravity(self) -> np.ndarray | None:
        """None: a bag does not say which way its world is up."""
        return None

    def __len__(self) -> int:
        return len(self.color)

    def __getitem__(self, index: int) -> Frame:
        """The frame at `index` (negative counts from the end).

        Raises:
            BrokenFrame: a message is damaged (`UNREADABLE`), of another size than the camera (`SIZE_MISMATCH`), or
                without any depth (`NO_DEPTH`).
            IndexError: there is no such frame.
        """
        i = range(len(self))[index]
        stamp = int(self.color[i, 0])
        name = f"{stamp // NANO}.{stamp % NANO:09d}"
        color = self.camera.undistort_color(self._read(name, i, of_depth=False))
        depth = self.camera.undistort_depth(self._read(name, i, of_depth=True))
        if not depth.any():
            detail = f"no pixel of {self.topics.depth.topic.name} has a depth"
            raise BrokenFrame(name, FrameProblem.NO_DEPTH, detail)
        return Frame(
            index=i,
            name=name,
            stamp=stamp / NANO,
            color=color,
            depth=depth,
            intrinsics=self.intrinsics,
            T_world_camera=_row(self.poses, i),
            specific_force=_row(self.specific_force, i),
        )

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))

    def _read(self, name: str, i: int, of_depth: bool) -> np.ndarray:
        topic = (self.topics.depth if of_depth else self.topics.color).topic.name
        stamp, logged = (self.depth if of_depth else self.color)[i].tolist()
        try:
            message = self.bag.read(topic, stamp, logged)
            image = decode_depth(message) if of_depth else decode_color(message)
        except BadMessage as error:
            raise BrokenFrame(name, FrameProblem.UNREADABLE, f"{topic}: {error}") from None
        height, width = image.shape[:2]
        k = self.intrinsics
        if (width, height) != (k.width, k.height):
            detail = f"{topic} is {width} x {height}, the camera {k.width} x {k.height}"
            raise BrokenFrame(name, FrameProblem.SIZE_MISMATCH, detail)
        return image


def _row(values: np.ndarray | None, i: int) -> np.ndarray | None:
    return None if values is None or np.isnan(values[i]).any() else values[i].copy()
