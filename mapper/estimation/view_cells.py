"""From where an object has been looked at, and what each direction said.

Georgakis et al. (equation (2)) multiply per-view distributions as if independent; near-identical views are not. Looks
from about the same place (a *cell*) are averaged, and n of them count as

    weight * n / (1 + rho (n - 1)),

Kish's design effect, where `weight` is how far the cell is from the nearest one before it, in units of
`BeliefConfig.view_angle` and `view_log_range`. So a camera that stands still for an hour says little more than one
look, and what it says does not depend on the order of its looks.

Not every look tells of everything: scores come with detections only, and of a half hidden thing depth tells half. So
each group of columns has its own n, the sum of the looks' masses in [0, 1].

A cell knows the keyframe of its first look, by which its place is found anew when poses are corrected (`place_anew`).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..config import BeliefConfig

NEW_CELL = 0.3  # novelty above which a place gets a cell of its own
MAX_CELLS = 64  # directions 10 degrees apart over half a sphere; beyond it the nearest cell takes the look
UNKNOWN = -1  # keyframe of a look of which only the place was told


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
        self._keyframes = np.empty(0, dtype=np.int64)  # of the first look; UNKNOWN where nobody said
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

    def add(self, object_to_camera: np.ndarray, masses: np.ndarray, said: np.ndarray, keyframe: int = UNKNOWN) -> None:
        """A keyframe's look from (3,) metres off the object: (columns,), times the (groups,) masses of its groups."""
        cell, weight = self.find(object_to_camera)
        if cell == len(self):
            self._append(_place(object_to_camera), keyframe, weight, 1.0, masses, said)
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
        cells = other._places, other._keyframes, other._weights, other._counts, other._masses, other._sums
        for place, keyframe, weight, count, masses, said in zip(*cells, strict=True):
            nearest, novelty = self._nearest(place)
            if novelty > NEW_CELL and len(self) < MAX_CELLS:
                self._append(place, keyframe, min(weight, novelty), count, masses, said)
            else:
                self._counts[nearest] += count
                self._masses[nearest] += masses
                self._sums[nearest] += said

    def place_anew(self, cameras: np.ndarray, position: np.ndarray) -> None:
        """Poses were corrected: where the looks came from as it is known now.

        Numbers of the cells and what they say stay; a cell whose keyframe is not known stays where it was.

        Args:
            cameras: (M, 3) world, metres: centres of all keyframes.
            position: (3,) of the object.
        """
        for cell in np.flatnonzero(self._keyframes != UNKNOWN):
            self._places[cell] = _place(cameras[self._keyframes[cell]] - position)

    def forget(self, keyframes: Iterable[int]) -> None:
        """Takes back what was said from where one of these keyframes was the first to look."""
        kept = ~np.isin(self._keyframes, [k for k in keyframes if k != UNKNOWN])
        self._places, self._keyframes = self._places[kept], self._keyframes[kept]
        self._weights, self._counts = self._weights[kept], self._counts[kept]
        self._masses, self._sums = self._masses[kept], self._sums[kept]

    def _append(
        self, place: np.ndarray, keyframe: int, weight: float, count: float, masses: np.ndarray, said: np.ndarray
    ) -> None:
        self._places, self._keyframes = np.vstack([self._places, place]), np.append(self._keyframes, keyframe)
        self._weights, self._counts = np.append(self._weights, weight), np.append(self._counts, count)
        self._masses, self._sums = np.vstack([self._masses, masses]), np.vstack([self._sums, said])

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
