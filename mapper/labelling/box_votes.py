"""How many points of each label lie in the middle of boxes."""

from __future__ import annotations

import numpy as np
from numba import njit

from ...datasets.truth import NO_OBJECT
from ...detectors.boxes import EDGE


def central_votes(xyxy: np.ndarray, uv: np.ndarray, label: np.ndarray, classes: int, central: float) -> np.ndarray:
    """(D, K + 1) number of points of each label in the central regions of D boxes, the background's last.

    Args:
        xyxy: (D, 4) boxes; they count from the image's outer edge, half a pixel before the first pixel's centre.
        uv: (V, 2) pixels of points, whole numbers at centres.
        label: (V,) 0..K-1, `NO_OBJECT` for background.
        classes: K.
        central: share of the width and height.
    """
    column = np.where(label == NO_OBJECT, classes, label)
    middle, half = (xyxy[:, :2] + xyxy[:, 2:]) / 2.0 - EDGE, (xyxy[:, 2:] - xyxy[:, :2]) * central / 2.0
    return _votes(middle - half, middle + half, uv, column, classes + 1)


@njit(cache=True)
def _votes(low: np.ndarray, high: np.ndarray, uv: np.ndarray, column: np.ndarray, columns: int) -> np.ndarray:
    votes = np.zeros((len(low), columns), np.int64)
    for i in range(len(uv)):
        u, v = uv[i, 0], uv[i, 1]
        for d in range(len(low)):
            if low[d, 0] <= u <= high[d, 0] and low[d, 1] <= v <= high[d, 1]:
                votes[d, column[i]] += 1
    return votes
