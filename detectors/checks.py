"""What every array of `Detections` must be; each check returns the value in its final type or raises ValueError."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import numpy as np


def checked_classes(classes: Sequence[str]) -> tuple[str, ...]:
    if isinstance(classes, str) or not all(isinstance(name, str) for name in classes):
        raise ValueError(f"classes must be a tuple of names, but got {classes!r}")
    if len(set(classes)) != len(classes):
        twice = next(name for name in classes if list(classes).count(name) > 1)
        raise ValueError(f"classes must differ from each other, but got {twice!r} twice")
    return tuple(classes)


def checked_boxes(xyxy: Any) -> np.ndarray:
    boxes = np.asarray(xyxy, dtype=np.float64)
    if boxes.ndim != 2 or boxes.shape[1] != 4:
        raise ValueError(f"xyxy must have shape (N, 4), but got shape {boxes.shape}")
    bad = ~np.isfinite(boxes).all(axis=1) | (boxes[:, 2:] < boxes[:, :2]).any(axis=1)
    if bad.any():
        raise ValueError(f"xyxy must be finite with x1 <= x2 and y1 <= y2, but got {boxes[bad][0].tolist()}")
    return boxes


def checked_scores(scores: Any, count: int, classes: int) -> np.ndarray:
    values = np.asarray(scores, dtype=np.float64)
    if values.shape != (count, classes):
        raise ValueError(f"scores must have shape ({count}, {classes}), but got shape {values.shape}")
    known = ~np.isnan(values)
    if not known.any(axis=1).all():
        raise ValueError("scores must have a number in every row, but got a row without any")
    outside = values[known & ~((values >= 0) & (values <= 1))]
    if len(outside):
        raise ValueError(f"scores must be in [0, 1] or NaN, but got {outside[0]}")
    return values


def checked_part(part: Any, count: int, allowed: type[IntEnum]) -> np.ndarray:
    values = np.zeros(count, dtype=np.int8) if part is None else np.asarray(part)
    if values.shape != (count,):
        raise ValueError(f"part must have shape ({count},), but got shape {values.shape}")
    if not np.isin(values, list(allowed)).all():
        raise ValueError(f"part must hold values of {allowed.__name__}, but got {values.tolist()}")
    return values.astype(np.int8, copy=False)


def checked_mask(mask: Any, count: int) -> np.ndarray:
    values = np.asarray(mask)
    if values.dtype != np.bool_ or values.ndim != 3 or len(values) != count:
        raise ValueError(f"mask must be bool of shape ({count}, H, W), but got {values.dtype} of shape {values.shape}")
    return values


def checked_embedding(embedding: Any, count: int) -> np.ndarray:
    values = np.asarray(embedding, dtype=np.float32)
    if values.ndim != 2 or len(values) != count or not np.isfinite(values).all():
        raise ValueError(f"embedding must be finite of shape ({count}, D), but got shape {values.shape}")
    return values
