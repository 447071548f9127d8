"""Where things are: near a point, in a region."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..map.region import Polygon, Region, as_region, probability_inside
from ..map.thing import Thing
from .answer import PROBABLE, Answer
from .names import NameQuestions


class PlaceQuestions(NameQuestions):
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
            label: only things that are one with at least `min_probability`, in words as for `find`, or the one that has
                this name; None for things of any class, by existence.
            count: how many; None for all.
            min_probability: of being what was asked for.
        """
        origin = np.asarray(point, dtype=np.float64)
        if origin.shape != (3,) or not np.all(np.isfinite(origin)):
            raise ValueError(f"point must be three finite numbers, but got {point!r}")
        near = self._called(label, min_probability)
        if near is None:
            near = self.index.near(origin, self._labels(label), count, min_probability)
        answers = [Answer(thing, probability, *_distance(origin, thing)) for thing, probability in near]
        return sorted(answers, key=lambda answer: (answer.distance, answer.thing.id))[:count]

    def within(self, region: object, label: str | None = None, min_probability: float = PROBABLE) -> list[Answer]:
        """Things whose centre is in a region with at least `min_probability`, likeliest first.

        Args:
            region: `((xmin, ymin, zmin), (xmax, ymax, zmax))` or `(centre, radius)`, metres, map frame; or the (M, 2)
                corners of a polygon of the floor plan, x and y along the first two axes of the upright frame
                (`R_world_upright`), metres, M >= 3; with the heights between which it stands `(corners, (low, high))`,
                metres along up. A polygon may have dents.
            label: as for `nearest`.
            min_probability: of existing, being a `label` and having its centre inside, all three.
        """
        where = as_region(region)
        called = self._called(label, min_probability)
        if called is not None:
            inside = self._inside(where, called, min_probability)
        elif isinstance(where, Polygon):
            near = self.index.over(where, self.R_world_upright, self._labels(label), min_probability)
            inside = self._inside(where, near, min_probability)
        else:
            inside = self.index.within(where, self._labels(label), min_probability)
        answers = [Answer(thing, probability) for thing, probability in inside]
        return sorted(answers, key=lambda answer: (-answer.probability, answer.thing.id))

    def _labels(self, text: str | None) -> tuple[str, ...] | None:
        """What the index is asked for; None for things of any class."""
        return None if text is None else self.understand(text).labels

    def _called(self, text: str | None, min_probability: float) -> list[tuple[Thing, float]] | None:
        """Things that are called so and exist with at least this probability; None where nothing is called so."""
        called = () if text is None else self.called(text)
        return [(thing, thing.existence) for thing in called if thing.existence >= min_probability] if called else None

    def _inside(
        self, region: Region, things: list[tuple[Thing, float]], min_probability: float
    ) -> list[tuple[Thing, float]]:
        """Those of the things, each with P(it is what was asked for), that are inside too, with P(both)."""
        R = self.R_world_upright if isinstance(region, Polygon) else np.eye(3)
        found = []
        for thing, probability in things:
            p = probability * probability_inside(region, R.T @ thing.position, R.T @ thing.position_covariance @ R)
            if p >= min_probability and p > 0.0:
                found.append((thing, p))
        return found


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
