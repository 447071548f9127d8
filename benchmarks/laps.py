"""A recorded sequence forwards and backwards, again and again: a camera that stays in a place it knows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.sequence import Sequence


@dataclass(frozen=True, eq=False)
class BackAndForth:
    """`laps` times to the end of a sequence and back; stamps go on evenly, frames keep their names."""

    sequence: Sequence
    laps: int

    @property
    def name(self) -> str:
        return self.sequence.name

    @property
    def names(self) -> list[str]:
        names = list(self.sequence.names)
        return [names[self._place(i)] for i in range(len(self))]

    @property
    def intrinsics(self) -> Intrinsics:
        return self.sequence.intrinsics

    @property
    def gravity(self) -> np.ndarray | None:
        return self.sequence.gravity

    @property
    def poses(self) -> np.ndarray | None:
        poses = self.sequence.poses
        return None if poses is None else poses[[self._place(i) for i in range(len(self))]]

    @property
    def stamps(self) -> np.ndarray:
        stamps = self.sequence.stamps
        step = (stamps[-1] - stamps[0]) / max(len(stamps) - 1, 1)
        return stamps[0] + step * np.arange(len(self))

    def __len__(self) -> int:
        return 2 * self.laps * len(self.sequence)

    def __getitem__(self, index: int) -> Frame:
        i = range(len(self))[index]
        return replace(self.sequence[self._place(i)], index=i, stamp=float(self.stamps[i]))

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))

    def _place(self, index: int) -> int:
        n = len(self.sequence)
        step = index % (2 * n)
        return step if step < n else 2 * n - 1 - step
