"""The labelled cloud that a map names: which points are whose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...datasets.errors import InputError, UserError
from .labels_file import read_instances
from .thing import Thing

LABEL = "label the run again with `thingmap label`, then load its map again"


@dataclass(frozen=True, slots=True, eq=False)
class LabelledCloud:
    """What the map's file says of labels.

    Attributes:
        file: the cloud; beside the map's own file. It is read when points are asked for, and then kept.
        points: class -> number of points, the background's too.
    """

    file: Path
    points: Mapping[str, int]
    _kept: dict[str, np.ndarray] = field(default_factory=dict, repr=False)

    def points_of(self, thing: Thing) -> np.ndarray:
        """(M, 3) float64 points of a thing, metres, map frame.

        Raises:
            UserError: the map was labelled without telling things apart.
            InputError: the cloud is missing or damaged, or it is that of another map: it holds another number of
                points for this thing than the map says.
        """
        if thing.points is None:
            raise UserError(f"{self.file}: nobody knows which points are {thing.id}'s; {LABEL}")
        if not self._kept:
            self._kept.update(read_instances(self.file))
        points = self._kept.get(thing.id, np.empty((0, 3)))
        if len(points) != thing.points:
            expected = f"the cloud of this map, with {thing.points} points for {thing.id}"
            raise InputError(self.file, expected, f"{len(points)}", LABEL)
        return points
