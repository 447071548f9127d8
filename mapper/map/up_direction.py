"""Which way is up in a map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class UpDirection:
    """Which way is up in the map: (3,) unit `direction`, the standard deviation of its angle, and who says so.

    `source` is such as "planes", "gravity file", "accelerometer" or "camera prior"; `std_rad` is in radians.
    """

    direction: np.ndarray
    std_rad: float
    source: str

    def __post_init__(self) -> None:
        direction = np.array(self.direction, dtype=np.float64)
        length = np.linalg.norm(direction)
        if direction.shape != (3,) or not abs(length - 1.0) < 1e-3:
            raise ValueError(f"up direction must be a (3,) unit vector, but got {self.direction!r}")
        if not 0.0 <= float(self.std_rad) < np.inf:
            raise ValueError(f"std_rad must be a finite number >= 0, but got {self.std_rad!r}")
        direction /= length
        direction.setflags(write=False)
        object.__setattr__(self, "direction", direction)
        object.__setattr__(self, "std_rad", float(self.std_rad))
