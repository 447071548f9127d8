"""What is known exactly about a scene: its objects, and what can be seen of them in every frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

PARTS = ("whole", "top", "bottom", "left", "right")  # columns of `FrameTruth.part_visibility`
NO_OBJECT = -1  # in instance images and labelled clouds: the room, or nothing


@dataclass(frozen=True, slots=True, eq=False)
class TrueObject:
    """One object: upright box in world coordinates, metres.

    `position` is the centre (3,), `size` the full extents (3,) along the object's own axes before `yaw`
    (radians about the world's up axis). Either is NaN where nobody measured it.
    """

    id: int
    label: str
    position: np.ndarray
    size: np.ndarray
    yaw: float


@dataclass(frozen=True, slots=True, eq=False)
class FrameTruth:
    """What can be seen of every object in one frame.

    Boxes have pixel centres at integers: one pixel (x, y) has the box (x - 0.5, y - 0.5, x + 0.5, y + 0.5).

    Attributes:
        object_id: (M,) ids of the objects at least partly in the image.
        xyxy: (M, 4) pixels, box of the whole silhouette, not clipped to the image.
        xyxy_visible: (M, 4) pixels, box of the visible pixels; NaN where none is.
        visibility: (M,) visible pixels / pixels of the whole silhouette (occlusion and image border both count).
        part_visibility: (M, 5) the same for the parts `PARTS`: the whole silhouette, and its pixels in the top,
            bottom, left and right half of its box. `visibility` for all parts where they are not measured apart.
    """

    object_id: np.ndarray
    xyxy: np.ndarray
    xyxy_visible: np.ndarray
    visibility: np.ndarray
    part_visibility: np.ndarray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.part_visibility is None:
            parts = np.repeat(np.asarray(self.visibility, dtype=np.float64)[:, None], len(PARTS), axis=1)
            object.__setattr__(self, "part_visibility", parts)


@dataclass(frozen=True, slots=True, eq=False)
class PointTruth:
    """A cloud of the scene whose points are labelled.

    Attributes:
        points: (P, 3) float32 metres, world.
        class_id: (P,) int64 index into the truth's classes, `NO_OBJECT` for everything else.
        object_id: (P,) int64 `TrueObject.id`, `NO_OBJECT` for everything else; None where only classes are known.
    """

    points: np.ndarray
    class_id: np.ndarray
    object_id: np.ndarray | None


@runtime_checkable
class HasTruth(Protocol):
    """A sequence whose objects are known."""

    objects: tuple[TrueObject, ...]
    classes: tuple[str, ...]

    def truth(self, index: int) -> FrameTruth: ...


@runtime_checkable
class HasClutter(Protocol):
    """A sequence that also knows the things of no class; their ids go on from the objects'."""

    @property
    def clutter(self) -> tuple[TrueObject, ...]: ...


@runtime_checkable
class HasInstances(Protocol):
    """A sequence that knows the thing behind every pixel."""

    def instances(self, index: int) -> np.ndarray:
        """(H, W) int32: `id` of the object or clutter that the pixel shows, `NO_OBJECT` elsewhere."""
        ...


@runtime_checkable
class HasPointTruth(Protocol):
    """A sequence whose fused cloud is labelled."""

    def point_truth(self) -> PointTruth: ...
