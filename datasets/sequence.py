"""What every recorded or rendered sequence offers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol, runtime_checkable

import numpy as np

from .frame import Frame, Intrinsics


@runtime_checkable
class Sequence(Protocol):
    """Random access to frames. `__getitem__` raises `BrokenFrame` for a frame that cannot be used.

    The attributes are properties here so that frozen dataclasses fulfil the protocol; plain attributes do as well.
    """

    @property
    def name(self) -> str:
        """Shown to people and written to `map.json`."""
        ...

    @property
    def names(self) -> Iterable[str]:
        """What the dataset calls its frames, in order: `Frame.name` of each."""
        ...

    @property
    def intrinsics(self) -> Intrinsics:
        """Shared by all frames."""
        ...

    @property
    def poses(self) -> np.ndarray | None:
        """(N, 4, 4) ground-truth `T_world_camera`, NaN where a frame has none; None without ground truth."""
        ...

    @property
    def stamps(self) -> np.ndarray:
        """(N,) seconds."""
        ...

    @property
    def gravity(self) -> np.ndarray | None:
        """(3,) unit vector pointing down in the dataset's world axes, or None where unknown."""
        ...

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> Frame: ...

    def __iter__(self) -> Iterator[Frame]: ...
