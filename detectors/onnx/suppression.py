"""Non-maximum suppression across classes."""

from __future__ import annotations

import numpy as np


def suppress(xyxy: np.ndarray, confidence: np.ndarray, iou: float, keep: int) -> np.ndarray:
    """Indices (M,) of at most `keep` boxes, best first, of which no two overlap by more than `iou`.

    Classes play no part. A mapper wants one box per object with its whole score vector: one mug seen as "cup" and
    as "bowl" is one piece of evidence about one object, whose class is settled over many views. Suppression per
    class would hand it over as two objects standing in each other. The price: of two real objects whose boxes
    nearly coincide, one is missed in that view.

    Args:
        xyxy: (N, 4) boxes.
        confidence: (N,) scores; of equal ones the first wins.
        iou: intersection over union above which the lesser box goes.
        keep: how many boxes at most.
    """
    area = (xyxy[:, 2] - xyxy[:, 0]) * (xyxy[:, 3] - xyxy[:, 1])
    left = np.argsort(-confidence, kind="stable")
    kept: list[int] = []
    while len(left) and len(kept) < keep:
        best, left = left[0], left[1:]
        kept.append(int(best))
        corner = np.maximum(xyxy[left, :2], xyxy[best, :2])
        overlap = (np.minimum(xyxy[left, 2:], xyxy[best, 2:]) - corner).clip(0.0).prod(axis=1)
        # Written without a division: boxes may have no area.
        left = left[overlap <= iou * (area[left] + area[best] - overlap)]
    return np.array(kept, dtype=np.int64)
