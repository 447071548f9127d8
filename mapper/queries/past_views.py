"""What has been looked at already, as far as the run's files tell: from where, and with what luck."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..config import BeliefConfig
from ..estimation.view_cells import ViewCells
from ..estimation.view_log import Verdict
from ..map.thing import Thing
from .run_files import nearest_in_time

ONE_LOOK = np.ones(1)


@dataclass(frozen=True, slots=True, eq=False)
class PastViews:
    """The looks at one thing.

    Attributes:
        cells: from where, by which the mapper judges how new a look is.
        hits, misses: independent views in which it was detected, and in which it should have been and was not.
    """

    cells: ViewCells
    hits: float
    misses: float

    def novelty(self, object_to_camera: np.ndarray) -> float:
        """How much a look from (3,) metres off the thing adds to the independent views, in [0, 1]."""
        return self.cells.find(object_to_camera)[1]

    def add(self, object_to_camera: np.ndarray) -> None:
        """One more look from there."""
        self.cells.add(object_to_camera, ONE_LOOK, np.zeros(1))


def past_views(thing: Thing, trajectory: tuple[np.ndarray, np.ndarray], config: BeliefConfig) -> PastViews:
    """The views that told something of a thing; none where its views or the trajectory are not known.

    Args:
        thing: of a map.
        trajectory: (N,) seconds and (N, 4, 4) `T_world_camera` of the run.
        config: which views are independent.

    Raises:
        InputError: the map's evidence file is damaged or of another map.
    """
    cells = ViewCells((1,), config)
    found = None if thing.views is None else thing.views.find()
    # a view that told nothing of it was given no weight
    notes = [] if found is None else [note for note in found.notes if note.weight > 0.0]
    past = PastViews(
        cells,
        hits=float(sum(note.weight for note in notes if note.verdict is Verdict.SUPPORTED)),
        misses=float(sum(note.weight for note in notes if note.verdict.contradicts)),
    )
    stamps, poses = trajectory
    if notes and len(stamps):
        for place in nearest_in_time(stamps, [note.stamp for note in notes]):
            past.add(poses[place, :3, 3] - thing.position)
    return past
