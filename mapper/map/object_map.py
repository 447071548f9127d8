"""The map of things and the questions people ask it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...datasets.errors import UserError
from .region import as_region, probability_inside
from .thing import Thing
from .upright import upright_rotation

if TYPE_CHECKING:
    from .labelled_cloud import LabelledCloud

PROBABLE = 0.5  # by default a question about places is answered with what is more likely true than not


class MapFrame(StrEnum):
    """Whose axes the coordinates of a map are in."""

    FIRST_CAMERA = "first camera"
    GRAVITY_ALIGNED = "gravity-aligned"
    DATASET = "dataset"


@dataclass(frozen=True, slots=True, eq=False)
class UpDirection:
    """Which way is up in the map: (3,) unit `direction`, the standard deviation of its angle, and who says so.

    `source` is such as "planes", "gravity file", "accelerometer" or "camera prior"; `std_rad` is in radians.
    """

    direction: np.ndarray
    std_rad: float
    source: str

    def __post_init__(self) -> None:
        direction = np.array(self.direction, dtype=np.float64)
        length = np.linalg.norm(direction)
        if direction.shape != (3,) or not abs(length - 1.0) < 1e-3:
            raise ValueError(f"up direction must be a (3,) unit vector, but got {self.direction!r}")
        if not 0.0 <= float(self.std_rad) < np.inf:
            raise ValueError(f"std_rad must be a finite number >= 0, but got {self.std_rad!r}")
        direction /= length
        direction.setflags(write=False)
        object.__setattr__(self, "direction", direction)
        object.__setattr__(self, "std_rad", float(self.std_rad))


@dataclass(frozen=True, slots=True)
class Answer:
    """One thing that answers a question.

    Attributes:
        thing: with its covariance and its whole class posterior.
        probability: P(the thing is what was asked for); with a region, also that its centre is in there.
        distance: metres from the point asked about to the thing's centre, None where no point was.
        distance_std: standard deviation of `distance`, metres, from the position's covariance.
    """

    thing: Thing
    probability: float
    distance: float | None = None
    distance_std: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ObjectMap:
    """Things in one frame of reference.

    Attributes:
        things: any order; ids are unique.
        classes: every label that the map knows, whether or not there is such a thing.
        source: what was mapped.
        frame: whose axes positions are in.
        up: needed to place the upright boxes.
        labels: the cloud whose points are labelled, where `thingmap label` wrote one.
    """

    things: tuple[Thing, ...]
    classes: tuple[str, ...]
    source: str
    frame: MapFrame
    up: UpDirection
    labels: LabelledCloud | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "things", tuple(self.things))
        object.__setattr__(self, "classes", tuple(self.classes))
        object.__setattr__(self, "frame", MapFrame(self.frame))
        ids = [thing.id for thing in self.things]
        if len(set(ids)) != len(ids):
            twice = sorted({i for i in ids if ids.count(i) > 1})
            raise ValueError(f"ids of things must be unique, but got {', '.join(twice)} more than once")

    def __len__(self) -> int:
        return len(self.things)

    @classmethod
    def load(cls, path: str | Path) -> ObjectMap:
        """Read the output folder of a run, or its `map.json`; raises `InputError` where it is not one."""
        from .map_file import read_map

        return read_map(Path(path))

    def save(self, path: str | Path, include_doubtful: bool = False, *, evidence: bool = True) -> Path:
        """Write to a `.json` file, or as `map.json` into a folder; returns the file, which is replaced if it was there.

        A labelled cloud is named as it was, beside the file; it is not copied.

        Args:
            path: where to.
            include_doubtful: write things whose existence is below 0.5 too.
            evidence: write what the views said too, so that things can be explained once they are loaded: into
                `evidence.npz` beside `map.json`, into `NAME.evidence.npz` beside `NAME.json`.
        """
        from .map_file import write_map

        return write_map(self, Path(path), include_doubtful, evidence)

    @property
    def R_world_upright(self) -> np.ndarray:
        """(3, 3) axes of the upright frame in which boxes are measured; argument of `Thing.corners`."""
        return upright_rotation(self.up.direction)

    def knows(self, label: str) -> bool:
        """Whether `label`, upper and lower case being the same, is a class of this map."""
        return label.casefold() in {name.casefold() for name in self.classes}

    def points(self, thing: Thing | str) -> np.ndarray:
        """(M, 3) points of a thing, metres, map frame: those of the labelled cloud that are its own; maybe none.

        Args:
            thing: of this map, or its id.

        Raises:
            UserError: there is no such thing, or the map is not labelled: it says what to do.
            InputError: the cloud is missing or damaged, or that of another map.
        """
        wanted = thing if isinstance(thing, str) else thing.id
        own = next((other for other in self.things if other.id == wanted), None)
        if own is None:
            raise UserError(f"{wanted}: the map of {self.source} has no such thing; ask for one of its things")
        if self.labels is None:
            raise UserError(
                f"the map of {self.source} is not labelled; label its run with `thingmap label OUT` and load it again"
            )
        return self.labels.points_of(own)

    def find(self, label: str, min_probability: float = 0.0) -> list[Answer]:
        """Things that may be a `label`, likeliest first.

        Each is ranked by existence times the probability of *that* label in its own posterior, so a thing that is
        likelier a bowl is still found as a cup. Things that cannot be a `label` are left out; an unknown label gives
        an empty list.
        """
        answers = [Answer(thing, thing.belief(label)) for thing in self.things]
        answers = [answer for answer in answers if answer.probability >= min_probability and answer.probability > 0.0]
        return sorted(answers, key=lambda answer: (-answer.probability, answer.thing.id))

    def nearest(
        self,
        point: Iterable[float],
        label: str | None = None,
        count: int | None = None,
        min_probability: float = PROBABLE,
    ) -> list[Answer]:
        """Things by the distance of their centres from `point` (3,), metres, map frame; nearest first.

        Args:
            point: where to measure from.
            label: only things that are one with at least `min_probability`; None for things of any class, by existence.
            count: how many; None for all.
            min_probability: of being what was asked for.
        """
        origin = np.asarray(point, dtype=np.float64)
        if origin.shape != (3,) or not np.all(np.isfinite(origin)):
            raise ValueError(f"point must be three finite numbers, but got {point!r}")
        answers = [
            Answer(thing, probability, *_distance(origin, thing))
            for thing, probability in self._asked_for(label, min_probability)
        ]
        return sorted(answers, key=lambda answer: (answer.distance, answer.thing.id))[:count]

    def within(self, region: object, label: str | None = None, min_probability: float = PROBABLE) -> list[Answer]:
        """Things whose centre is in a region with at least `min_probability`, likeliest first.

        Args:
            region: `((xmin, ymin, zmin), (xmax, ymax, zmax))` or `(centre, radius)`, metres, map frame.
            label: as for `nearest`.
            min_probability: of existing, being a `label` and having its centre inside, all three.
        """
        where = as_region(region)
        answers = [
            Answer(thing, probability * probability_inside(where, thing.position, thing.position_covariance))
            for thing, probability in self._asked_for(label, min_probability)
        ]
        answers = [answer for answer in answers if answer.probability >= min_probability and answer.probability > 0.0]
        return sorted(answers, key=lambda answer: (-answer.probability, answer.thing.id))

    def _asked_for(self, label: str | None, min_probability: float) -> list[tuple[Thing, float]]:
        asked = [(thing, thing.existence if label is None else thing.belief(label)) for thing in self.things]
        return [(thing, p) for thing, p in asked if p >= min_probability and p > 0.0]


def _distance(origin: np.ndarray, thing: Thing) -> tuple[float, float]:
    """|p - origin| and its first-order standard deviation sqrt(u' C u), u the unit direction; at the centre itself,
    where there is no direction, the widest one is taken."""
    offset = thing.position - origin
    distance = float(np.linalg.norm(offset))
    if distance < 1e-9:
        variance = np.linalg.eigvalsh(thing.position_covariance)[-1]
    else:
        variance = offset @ thing.position_covariance @ offset / distance**2
    return distance, float(np.sqrt(max(variance, 0.0)))
