"""Boxes, scores and parts found in one image."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np

from .checks import (
    checked_boxes,
    checked_classes,
    checked_embedding,
    checked_mask,
    checked_part,
    checked_scores,
)


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

    Arrays of another numeric type are converted. Box corners count from the image's outer edges, as detectors
    give them: an image spans [0, W] x [0, H].

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
        def fix(name: str, value: object) -> None:
            object.__setattr__(self, name, value)

        fix("classes", checked_classes(self.classes))
        fix("xyxy", checked_boxes(self.xyxy))
        fix("scores", checked_scores(self.scores, len(self), len(self.classes)))
        fix("part", checked_part(self.part, len(self), Part))
        if self.mask is not None:
            fix("mask", checked_mask(self.mask, len(self)))
        if self.embedding is not None:
            fix("embedding", checked_embedding(self.embedding, len(self)))

    def __len__(self) -> int:
        return len(self.xyxy)

    @property
    def class_id(self) -> np.ndarray:
        """(N,) int64, index of the best class; the first of equal ones."""
        if len(self) == 0:
            return np.zeros(0, dtype=np.int64)
        return np.nanargmax(self.scores, axis=1)

    @property
    def confidence(self) -> np.ndarray:
        """(N,) score of the best class."""
        return self.scores[np.arange(len(self)), self.class_id]

    def select(self, index: np.ndarray | slice | Sequence[int]) -> Detections:
        """The detections that a slice, a boolean mask (N,) or indices (M,) name, in that order."""
        rows = np.arange(len(self))[index]
        return replace(
            self,
            xyxy=self.xyxy[rows],
            scores=self.scores[rows],
            part=self.part[rows],
            mask=None if self.mask is None else self.mask[rows],
            embedding=None if self.embedding is None else self.embedding[rows],
        )

    def clip(self, width: int, height: int) -> Detections:
        """Boxes cut to the image; those with no area inside it are left out."""
        limits = np.array([width, height, width, height], dtype=np.float64)
        cut = replace(self, xyxy=np.clip(self.xyxy, 0.0, limits))
        has_area = (cut.xyxy[:, 2] > cut.xyxy[:, 0]) & (cut.xyxy[:, 3] > cut.xyxy[:, 1])
        return cut if has_area.all() else cut.select(has_area)

    @classmethod
    def empty(cls, classes: Sequence[str]) -> Detections:
        """No detections over the given classes."""
        return cls(tuple(classes), np.zeros((0, 4)), np.zeros((0, len(classes))))

    @classmethod
    def concatenate(cls, several: Iterable[Detections]) -> Detections:
        """Detections of one image from several sources over the same classes, in order.

        Raises:
            ValueError: for no sources, differing classes, or a mask or an embedding that only some sources have.
        """
        items = list(several)
        if not items:
            raise ValueError("concatenate needs at least one Detections")
        if any(item.classes != items[0].classes for item in items):
            raise ValueError("concatenate needs equal classes in the same order")
        items = [item for item in items if len(item)] or items[:1]
        return cls(
            items[0].classes,
            np.concatenate([item.xyxy for item in items]),
            np.concatenate([item.scores for item in items]),
            np.concatenate([item.part for item in items]),
            _concatenated("mask", [item.mask for item in items]),
            _concatenated("embedding", [item.embedding for item in items]),
        )

    @classmethod
    def from_best_class(
        cls, classes: Sequence[str], xyxy: Any, class_id: Any, confidence: Any, mask: Any | None = None
    ) -> Detections:
        """Detections of which only the best class (N,) and its score (N,) are known: NaN elsewhere in `scores`.

        Raises:
            ValueError: as the class does, and for a class_id outside 0..K-1.
        """
        if len(xyxy) == 0:
            return cls.empty(classes)
        column = np.asarray(class_id)
        outside = column[~np.isin(column, np.arange(len(classes)))]
        if len(outside):
            raise ValueError(f"class_id must be one of 0..{len(classes) - 1}, but got {outside[0]}")
        scores = np.full((len(column), len(classes)), np.nan)
        scores[np.arange(len(column)), column.astype(np.int64)] = confidence
        return cls(tuple(classes), xyxy, scores, mask=mask)

    @classmethod
    def from_supervision(cls, found: Any, classes: Sequence[str] | None = None) -> Detections:
        """See `detections_from.from_supervision`."""
        from .detections_from import from_supervision

        return from_supervision(found, classes)

    @classmethod
    def from_ultralytics(cls, result: Any) -> Detections:
        """See `detections_from.from_ultralytics`."""
        from .detections_from import from_ultralytics

        return from_ultralytics(result)

    @classmethod
    def from_coco(cls, annotations: Sequence[dict], categories: Sequence[dict] | None = None) -> Detections:
        """See `detections_from.from_coco`."""
        from .detections_from import from_coco

        return from_coco(annotations, categories)


def _concatenated(name: str, arrays: list[np.ndarray | None]) -> np.ndarray | None:
    present = [array for array in arrays if array is not None]
    if not present:
        return None
    if len(present) != len(arrays):
        raise ValueError(f"concatenate needs {name} in all or in none")
    return np.concatenate(present)
