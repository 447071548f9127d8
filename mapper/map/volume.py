"""What the graph estimated of a thing's place and size, kept where labelled points have told better."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...datasets.json_record import JsonRecord
from .thing_checks import finite, read_only

if TYPE_CHECKING:
    from .thing import Thing

ARRAYS = ("position", "size", "size_std")


@dataclass(frozen=True, slots=True, eq=False)
class Volume:
    """(3,) `position`, `size` and `size_std` in metres, and `yaw` in radians, as they are of a `Thing`.

    Raises:
        ValueError: where a shape or a value is not as there.
    """

    position: np.ndarray
    size: np.ndarray
    size_std: np.ndarray
    yaw: float

    def __post_init__(self) -> None:
        for name in ARRAYS:
            object.__setattr__(self, name, read_only(f"volume.{name}", getattr(self, name), (3,)))
        object.__setattr__(self, "yaw", finite("volume.yaw", self.yaw))
        if min(self.size.tolist()) < 0.0 or min(self.size_std.tolist()) < 0.0:
            raise ValueError(f"size and size_std must not be negative, but got {self.size} and {self.size_std}")

    def of(self, thing: Thing) -> Thing:
        """The thing as it was before its points had a say."""
        values: dict[str, Any] = {name: getattr(self, name) for name in (*ARRAYS, "yaw")}
        return replace(thing, **values, volume=None)

    def to_dict(self) -> dict[str, Any]:
        """JSON values, as `volume_from` reads them."""
        return {**{name: getattr(self, name).tolist() for name in ARRAYS}, "yaw": self.yaw}


def volume_from(record: JsonRecord) -> Volume:
    """The inverse of `Volume.to_dict`; raises `InputError`."""
    with record.explaining():
        position, size, size_std = (record.array(name, (3,)) for name in ARRAYS)
        return Volume(position, size, size_std, record.number("yaw"))
