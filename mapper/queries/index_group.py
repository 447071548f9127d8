"""Things that are probably what was asked for, laid out so that places are found quickly."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

SLACK = 1e-9  # relative: distances of the tree and of NumPy differ in the last digits


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """Things that are what was asked for, each with at least some probability; M of them.

    Attributes:
        rows: (M,) places in the map's `things`.
        probability: (M,) of being that.
        positions: (M, 3) metres.
        by_x: (M,) order by the x coordinate.
        sorted: (3, M) metres: the positions in that order.
    """

    rows: np.ndarray
    probability: np.ndarray
    positions: np.ndarray
    by_x: np.ndarray
    sorted: np.ndarray
    _tree: list = field(default_factory=list, repr=False)

    @classmethod
    def of(cls, rows: np.ndarray, probability: np.ndarray, positions: np.ndarray) -> Asked:
        """With the order made."""
        by_x = np.argsort(positions[:, 0], kind="stable")
        return cls(rows, probability, positions, by_x, np.ascontiguousarray(positions[by_x].T))

    def in_box(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Places in `rows` of all whose position is in an axis-aligned box, (3,) metres each."""
        first, end = np.searchsorted(self.sorted[0], (low[0], high[0]))
        y, z = self.sorted[1:, first:end]
        inside = (y >= low[1]) & (y <= high[1]) & (z >= low[2]) & (z <= high[2])
        return self.by_x[first:end][inside]

    def near(self, origin: np.ndarray, count: int | None) -> np.ndarray:
        """Places in `rows` of all that are as near as the `count`-th nearest; every place where count is None."""
        if count is None or count >= len(self.rows):
            return np.arange(len(self.rows))
        if count <= 0:
            return np.empty(0, dtype=np.int64)
        if not self._tree:
            from scipy.spatial import KDTree

            self._tree.append(KDTree(self.positions))
        distance, place = self._tree[0].query(origin, k=count + 1)
        limit = distance[-2] * (1.0 + SLACK) + 1e-12
        if distance[-1] > limit:
            return place[:-1]
        return np.array(self._tree[0].query_ball_point(origin, limit), dtype=np.int64)  # several are equally far
