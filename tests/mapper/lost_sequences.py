"""A sequence cut and spliced: a camera that is covered, carried off, or shown too little of a fast motion."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from thingmap.datasets.frame import Frame, Intrinsics

PERIOD = 1.0 / 30.0  # s
HAND = 0.35  # m, from the lens
SKIN = (196, 148, 120)  # RGB


class Cover(Enum):
    """What is before the lens."""

    CAP = "cap"  # too near for a depth camera: no reading at all
    HAND = "hand"


@dataclass(frozen=True, eq=False)
class Spliced:
    """Frames of another sequence in another order; stamps go on evenly, but for `pauses`.

    Attributes:
        frames: of the other sequence, by their own order; those of a `Sequence` or a list.
        order: which of them are shown, one after the other.
        covered: positions in `order` at which something is before the lens.
        cover: what that is.
        pauses: seconds, beyond the usual period, that pass before a position.
    """

    frames: Sequence[Frame]
    order: Sequence[int]
    covered: Collection[int] = ()
    cover: Cover = Cover.CAP
    pauses: dict[int, float] | None = None
    name: str = "spliced"
    gravity: np.ndarray | None = None

    @property
    def intrinsics(self) -> Intrinsics:
        return self.frames[0].intrinsics

    @property
    def stamps(self) -> np.ndarray:
        steps = np.full(len(self.order), PERIOD)
        for position, seconds in (self.pauses or {}).items():
            steps[position] += seconds
        return np.cumsum(steps)

    def __len__(self) -> int:
        return len(self.order)

    def __getitem__(self, position: int) -> Frame:
        i = range(len(self))[position]
        frame = replace(self.frames[self.order[i]], index=i, name=f"frame-{i:06d}", stamp=float(self.stamps[i]))
        return _covered(frame, self.cover) if i in self.covered else frame

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))


def _covered(frame: Frame, cover: Cover) -> Frame:
    if cover is Cover.CAP:
        return replace(frame, color=np.zeros_like(frame.color), depth=np.zeros_like(frame.depth))
    noise = np.random.default_rng(frame.index)
    depth = HAND + noise.normal(0.0, 0.002, frame.depth.shape)
    color = np.clip(np.array(SKIN) + noise.normal(0.0, 4.0, frame.color.shape), 0, 255)
    return replace(frame, color=color.astype(np.uint8), depth=depth.astype(np.float32))
