"""What every recorded or rendered sequence offers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol, runtime_checkable

import numpy as np

from .frame import Frame, Intrinsics


@runtime_checkable
class Sequence(Protocol):
    """Random access to frames. `__getitem__` raises `BrokenFrame` for a frame that cannot be used.

    Attributes:
        name: shown to people and written to `map.json`.
        intrinsics: shared by all frames.
        poses: (N, 4, 4) ground-truth `T_world_camera`, NaN where a frame has none; None without ground truth.
        stamps: (N,) seconds.
        gravity: (3,) unit vector pointing down in the dataset's world axes, or None where unknown.
    """

    name: str
    intrinsics: Intrinsics
    poses: np.ndarray | None
    stamps: np.ndarray
    gravity: np.ndarray | None

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> Frame: ...

    def __iter__(self) -> Iterator[Frame]: ...
