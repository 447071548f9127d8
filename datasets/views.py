"""Parts of a sequence: every n-th frame, the first so many, only the usable ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from .errors import UserError
from .frame import BrokenFrame, Frame, Intrinsics
from .sequence import Sequence
from .truth import FrameTruth, HasClutter, HasInstances, HasPointTruth, HasTruth, TrueObject


@dataclass(frozen=True, eq=False)
class Subset:
    """Some frames of another sequence, in the order of `indices`.

    `Frame.index` is the position in the subset, so that it indexes the subset's own `stamps` and `poses`; `Frame.name`
    is unchanged. Iteration ends at the first broken frame, as that of the whole sequence: see `usable_frames`.

    Attributes:
        sequence: the whole sequence.
        indices: positions in it.
    """

    sequence: Sequence
    indices: range

    @property
    def name(self) -> str:
        """Name of the whole sequence."""
        return self.sequence.name

    @property
    def names(self) -> tuple[str, ...]:
        """Names of these frames."""
        return tuple(self.sequence.names)[self._slice]

    @property
    def intrinsics(self) -> Intrinsics:
        """Intrinsics of the whole sequence."""
        return self.sequence.intrinsics

    @property
    def gravity(self) -> np.ndarray | None:
        """(3,) unit vector down in the dataset's world axes, or None."""
        return self.sequence.gravity

    @property
    def stamps(self) -> np.ndarray:
        """(N,) seconds."""
        return self.sequence.stamps[self._slice]

    @property
    def poses(self) -> np.ndarray | None:
        """(N, 4, 4) `T_world_camera`, NaN where a frame has none; None without ground truth."""
        return None if self.sequence.poses is None else self.sequence.poses[self._slice]

    @property
    def _slice(self) -> slice:
        return slice(self.indices.start, self.indices.stop, self.indices.step)

    def __len__(self) -> int:
        return len(self.indices)

    def __getitem__(self, index: int) -> Frame:
        """The frame at `index` of the subset.

        Raises:
            BrokenFrame: as the whole sequence.
            IndexError: there is no such frame.
        """
        position = range(len(self.indices))[index]
        return replace(self.sequence[self.indices[position]], index=position)

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))


@dataclass(frozen=True, eq=False)
class TruthSubset(Subset):
    """A subset of a sequence whose objects are known (`HasTruth`).

    Where the whole sequence is `HasClutter`, `HasInstances` or `HasPointTruth`, so is the subset; its scene and its
    cloud are those of the whole.
    """

    objects: tuple[TrueObject, ...]
    classes: tuple[str, ...]
    whole_truth: Callable[[int], FrameTruth]

    def __post_init__(self) -> None:
        # Attributes of the instance, because a method of the class would promise what the whole may not have.
        whole = self.sequence
        if isinstance(whole, HasClutter):
            object.__setattr__(self, "clutter", whole.clutter)
        if isinstance(whole, HasInstances):
            object.__setattr__(self, "instances", self._instances)
        if isinstance(whole, HasPointTruth):
            object.__setattr__(self, "point_truth", whole.point_truth)

    def truth(self, index: int) -> FrameTruth:
        """What can be seen of every object in the frame at `index` of the subset."""
        return self.whole_truth(self.indices[index])

    def _instances(self, index: int) -> np.ndarray:
        assert isinstance(self.sequence, HasInstances)
        return self.sequence.instances(self.indices[index])


def subset(sequence: Sequence, stride: int = 1, max_frames: int | None = None) -> Sequence:
    """Every `stride`-th frame from the first, at most `max_frames`; the sequence itself where that is all of it.

    Raises:
        UserError: stride or max_frames is below 1.
    """
    if stride < 1:
        raise UserError(f"the stride must be at least 1, got {stride}")
    if max_frames is not None and max_frames < 1:
        raise UserError(f"the number of frames must be at least 1, got {max_frames}")
    indices = range(0, len(sequence), stride)[:max_frames]
    if len(indices) == len(sequence):
        return sequence
    if isinstance(sequence, HasTruth):
        return TruthSubset(sequence, indices, sequence.objects, sequence.classes, sequence.truth)
    return Subset(sequence, indices)


def usable_frames(sequence: Sequence, on_broken: Callable[[BrokenFrame], None]) -> Iterator[Frame]:
    """The frames that can be used, in order; each of the others is handed to `on_broken` as its reason."""
    for index in range(len(sequence)):
        try:
            frame = sequence[index]
        except BrokenFrame as broken:
            on_broken(broken)
        else:
            yield frame
