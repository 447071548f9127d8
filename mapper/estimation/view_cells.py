"""From where an object has been looked at, and what each direction said.

Georgakis et al. (equation (2)) multiply per-view distributions as if independent; near-identical views are not. Looks
from about the same place (a *cell*) are averaged, and n of them count as

    weight * n / (1 + rho (n - 1)),

Kish's design effect, where `weight` is how far the cell is from the nearest one before it, in units of
`BeliefConfig.view_angle` and `view_log_range`. So a camera that stands still for an hour says little more than one
look, and what it says does not depend on the order of its looks.

Not every look tells of everything: scores come with detections only, and of a half hidden thing depth tells half. So
each group of columns has its own n, the sum of the looks' masses in [0, 1].
"""

from __future__ import annotations

import numpy as np

from ..config import BeliefConfig

NEW_CELL = 0.3  # novelty above which a place gets a cell of its own
MAX_CELLS = 64  # directions 10 degrees apart over half a sphere; beyond it the nearest cell takes the look


class ViewCells:
    """Averages of looks by direction and distance.

    Args:
        groups: how many numbers of a look share a mass, for each group.
        config: how far apart views are independent.
    """

    def __init__(self, groups: tuple[int, ...], config: BeliefConfig) -> None:
        self._config = config
        self._group = np.repeat(np.arange(len(groups)), groups)  # of every column
        self._places = np.empty((0, 4))  # direction, log range
        self._weights, self._counts = np.empty(0), np.empty(0)
        self._masses, self._sums = np.empty((0, len(groups))), np.empty((0, sum(groups)))

    def __len__(self) -> int:
        return len(self._counts)

    def find(self, object_to_camera: np.ndarray) -> tuple[int, float]:
        """Cell of a look from (3,) metres off the object, and what the look would add to the independent views.

        A number equal to the length of this is a cell that does not exist yet.
        """
        nearest, novelty = self._nearest(_place(object_to_camera))
        if novelty > NEW_CELL and len(self) < MAX_CELLS:
            return len(self), novelty
        n = self._counts[nearest]
        return nearest, float(self._weights[nearest] * (self._views(n + 1.0) - self._views(n)))

    def add(self, object_to_camera: np.ndarray, masses: np.ndarray, said: np.ndarray) -> None:
        """A look from (3,) metres off the object that said (columns,), times the (groups,) masses of its groups."""
        cell, weight = self.find(object_to_camera)
        if cell == len(self):
            self._append(_place(object_to_camera), weight, 1.0, masses, said)
        else:
            self._counts[cell] += 1.0
            self._masses[cell] += masses
            self._sums[cell] += said

    def totals(self) -> np.ndarray:
        """(columns,) what all looks say together."""
        n = self._masses
        share = self._weights[:, None] * self._views(n) / np.maximum(n, 1e-12)
        return (share[:, self._group] * self._sums).sum(axis=0)

    def views(self) -> np.ndarray:
        """(groups,) independent views that told of each group."""
        return self._weights @ self._views(self._masses)

    def absorb(self, other: ViewCells) -> None:
        """Takes over the looks of a landmark merged into this one: its cells join the nearest here, or are new."""
        cells = other._places, other._weights, other._counts, other._masses, other._sums
        for place, weight, count, masses, said in zip(*cells, strict=True):
            nearest, novelty = self._nearest(place)
            if novelty > NEW_CELL and len(self) < MAX_CELLS:
                self._append(place, min(weight, novelty), count, masses, said)
            else:
                self._counts[nearest] += count
                self._masses[nearest] += masses
                self._sums[nearest] += said

    def _append(self, place: np.ndarray, weight: float, count: float, masses: np.ndarray, said: np.ndarray) -> None:
        self._places, self._weights = np.vstack([self._places, place]), np.append(self._weights, weight)
        self._counts, self._masses = np.append(self._counts, count), np.vstack([self._masses, masses])
        self._sums = np.vstack([self._sums, said])

    def _nearest(self, place: np.ndarray) -> tuple[int, float]:
        """The nearest cell and how new the place is beside it, 0 to 1."""
        if not len(self):
            return -1, 1.0
        c = self._config
        angle = np.arccos(np.clip(self._places[:, :3] @ place[:3], -1.0, 1.0)) / c.view_angle
        distance = np.hypot(angle, (self._places[:, 3] - place[3]) / c.view_log_range)
        nearest = int(np.argmin(distance))
        return nearest, min(1.0, float(distance[nearest]))

    def _views(self, n: np.ndarray | float) -> np.ndarray | float:
        """Independent views that a mass of n counts as; up to 1 as itself."""
        return n / (1.0 + self._config.repeat_correlation * np.maximum(n - 1.0, 0.0))


def _place(object_to_camera: np.ndarray) -> np.ndarray:
    distance = max(float(np.linalg.norm(object_to_camera)), 1e-3)
    return np.append(object_to_camera / distance, np.log(distance))
