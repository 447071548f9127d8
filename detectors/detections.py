"""Boxes, scores and parts found in one image."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np


class Part(IntEnum):
    """Which part of the object a box shows (Meger et al., Explicit Occlusion, section 2.3)."""

    WHOLE = 0
    TOP = 1
    BOTTOM = 2
    LEFT = 3
    RIGHT = 4


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """N detections in one image over K named classes.

    Attributes:
        classes: K class names; column k of `scores` belongs to `classes[k]`.
        xyxy: (N, 4) pixels, float64, clipped to the image.
        scores: (N, K) in [0, 1], float64; independent scores or a distribution, as the detector gives them. A
            detector that reports only the best class leaves NaN in the other columns.
        part: (N,) `Part` values; whole objects by default.
        mask: (N, H, W) bool, or None.
        embedding: (N, D) float32, or None.

    Raises:
        ValueError: where a shape or a value is not as above; it says which and what was found.
    """

    classes: tuple[str, ...]
    xyxy: np.ndarray
    scores: np.ndarray
    part: np.ndarray = field(default=None)  # type: ignore[assignment]
    mask: np.ndarray | None = None
    embedding: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.part is None:
            object.__setattr__(self, "part", np.zeros(len(self.xyxy), dtype=np.int8))

    def __len__(self) -> int:
        return len(self.xyxy)

    @property
    def class_id(self) -> np.ndarray:
        """(N,) index of the best class."""
        raise NotImplementedError

    @property
    def confidence(self) -> np.ndarray:
        """(N,) score of the best class."""
        raise NotImplementedError
