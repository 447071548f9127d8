"""Areas of boxes, and what boxes have in common; (N, 4) xyxy in any unit, NaN for a box that is not there."""

from __future__ import annotations

import numpy as np

EDGE = 0.5  # pixels from the image's outer edge, where detectors count from, to the centre of the first pixel


def areas(boxes: np.ndarray) -> np.ndarray:
    """(N,); 0 for a box without inside, and for NaN."""
    return np.maximum(np.nan_to_num(boxes[:, 2:] - boxes[:, :2]), 0.0).prod(axis=1)


def common_areas(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N, M) of (N, 4) and (M, 4) boxes."""
    size = np.minimum(a[:, None, 2:], b[None, :, 2:]) - np.maximum(a[:, None, :2], b[None, :, :2])
    return np.maximum(np.nan_to_num(size), 0.0).prod(axis=2)


def box_ious(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N, M) intersection over union of (N, 4) and (M, 4) boxes; 0 where one is NaN or has no area."""
    common = common_areas(a, b)
    union = areas(a)[:, None] + areas(b)[None] - common
    return np.divide(common, union, out=np.zeros_like(common), where=common > 0.0)


def cut_to_image(boxes: np.ndarray, width: int, height: int) -> np.ndarray:
    """(N, 4) pixels, without what lies outside of the image; NaN stays NaN."""
    return np.clip(boxes, 0.0, np.array([width, height, width, height], dtype=np.float64))
