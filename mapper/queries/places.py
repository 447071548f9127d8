"""Where things are: near a point, in a region."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..map.region import as_region, probability_inside
from ..map.thing import Thing
from .answer import PROBABLE, Answer
from .map_content import MapContent


class PlaceQuestions(MapContent):
    """Questions about places."""

    __slots__ = ()

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
