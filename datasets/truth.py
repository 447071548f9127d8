"""What is known exactly about a synthetic scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class TrueObject:
    """One object: upright box in world coordinates, metres.

    `position` is the centre (3,), `size` the full extents (3,) along the object's own axes before `yaw`
    (radians about the world's up axis).
    """

    id: int
    label: str
    position: np.ndarray
    size: np.ndarray
    yaw: float


@dataclass(frozen=True, slots=True, eq=False)
class FrameTruth:
    """What can be seen of every object in one frame.

    Attributes:
        object_id: (M,) ids of the objects at least partly in the image.
        xyxy: (M, 4) pixels, box of the whole silhouette, not clipped to the image.
        xyxy_visible: (M, 4) pixels, box of the visible pixels; NaN where none is.
        visibility: (M,) visible pixels / pixels of the whole silhouette (occlusion and image border both count).
    """

    object_id: np.ndarray
    xyxy: np.ndarray
    xyxy_visible: np.ndarray
    visibility: np.ndarray


@runtime_checkable
class HasTruth(Protocol):
    """A sequence whose objects are known."""

    objects: tuple[TrueObject, ...]
    classes: tuple[str, ...]

    def truth(self, index: int) -> FrameTruth: ...
