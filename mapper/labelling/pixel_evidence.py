"""What one frame says of its pixels: for each the log probability of every class, and of none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from ...datasets.frame import Frame


@dataclass(frozen=True, slots=True, eq=False)
class PixelEvidence:
    """P pixels of a frame and what they are.

    Rows do not sum to one: each class is told from everything else by itself (Lai et al., eq. 3 to 5).

    Attributes:
        classes: K names.
        uv: (P, 2) int32 pixels (column, row).
        log_p: (P, K + 1) float32, ln p(c | x) of each class, the background's last; finite.

    Raises:
        ValueError: for other shapes, or a probability of nothing.
    """

    classes: tuple[str, ...]
    uv: np.ndarray
    log_p: np.ndarray

    def __post_init__(self) -> None:
        if self.uv.ndim != 2 or self.uv.shape[1] != 2:
            raise ValueError(f"uv must have shape (P, 2), but got shape {self.uv.shape}")
        expected = (len(self.uv), len(self.classes) + 1)
        if self.log_p.shape != expected:
            raise ValueError(f"log_p must have shape {expected}, but got shape {self.log_p.shape}")
        if not np.isfinite(self.log_p).all():
            raise ValueError("log_p must be finite: no pixel is of a class with probability 0")

    def over(self, classes: Sequence[str], absent: float) -> PixelEvidence:
        """The same in the order of other classes, among which all of these are; others have the probability `absent`.

        Upper and lower case are the same.
        """
        if tuple(classes) == self.classes:
            return self
        column = {name.casefold(): k for k, name in enumerate(self.classes)}
        log_p = np.full((len(self.uv), len(classes) + 1), np.log(absent), dtype=np.float32)
        for k, name in enumerate(classes):
            if name.casefold() in column:
                log_p[:, k] = self.log_p[:, column[name.casefold()]]
        log_p[:, -1] = self.log_p[:, -1]
        return PixelEvidence(tuple(classes), self.uv, log_p)


def pixel_grid(frame: Frame, step: int, near: float, far: float) -> np.ndarray:
    """(P, 2) int32: every `step`-th column of every `step`-th row whose depth is in [near, far], metres, row by row."""
    depth = np.ascontiguousarray(frame.depth, dtype=np.float32)
    return _in_range(depth, step, max(np.float32(near), np.finfo(np.float32).tiny), np.float32(far))


@njit(cache=True, nogil=True)
def _in_range(depth, step, near, far) -> np.ndarray:  # pragma: no cover
    height, width = depth.shape
    uv, count = np.empty((-(-height // step) * -(-width // step), 2), np.int32), 0
    for v in range(0, height, step):
        for u in range(0, width, step):
            uv[count, 0], uv[count, 1] = u, v
            count += near <= depth[v, u] <= far
    return uv[:count]
