"""Points on edges of an image, as descriptors take them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class EdgeMap:
    """E points on edges, in row-major order of their pixels.

    Attributes:
        shape: (rows, columns) of the image.
        columns: (E,) int32.
        rows: (E,) int32.
        row_start: (rows + 1,) int64; the points of row y are row_start[y] to row_start[y + 1], by growing column.
        orientation: (E,) float32 radians in [0, pi): direction of the image's gradient across the edge, from the x axis
            towards y, that is downwards.
        depth: (E,) float32 metres of the nearer of the surfaces that meet there; 0 where nothing near was measured.
        is_depth: (E,) bool, True where the depth image has an edge, False where only the colours have one.
    """

    shape: tuple[int, int]
    columns: np.ndarray
    rows: np.ndarray
    row_start: np.ndarray
    orientation: np.ndarray
    depth: np.ndarray
    is_depth: np.ndarray

    def __len__(self) -> int:
        return len(self.columns)

    def select(self, keep: np.ndarray) -> EdgeMap:
        """The points that a (E,) bool mask names."""
        counts = np.bincount(self.rows[keep], minlength=self.shape[0])
        start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        rest = self.orientation[keep], self.depth[keep], self.is_depth[keep]
        return EdgeMap(self.shape, self.columns[keep], self.rows[keep], start, *rest)
