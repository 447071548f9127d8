"""Finds things among many: by id, by given name, by label, by place.

What the index gives is the same as going through all things would give. It holds arrays, sorted by one coordinate, and
KD-trees over what is probable enough; each is made when it is first needed and kept. SQLite's R*Tree names the things
in a box quicker than the sorted array does, but both take some hundredths of a millisecond of 100,000 things, after
which probabilities take a tenth; filling the R*Tree takes many times as long, and it cannot tell what is nearest
(`benchmarks/map_index.py`).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ..map.polygon import Polygon
from ..map.region import Ball, Box
from ..map.thing import Thing
from .answer import Answer
from .index_group import Asked
from .index_words import ThingWords
from .inside import INTEGRAL_ERROR, inside_or_nan

Labels = str | Sequence[str] | None  # one, several of which any will do, or things of any class
KEPT_LABELS = 256  # questions for labels whose answers are kept
KEPT_GROUPS = 32  # groups of things with their trees; one of 100,000 takes 10 MB
FARTHEST = 40.0  # standard deviations beyond which a normal probability is 0 in double precision
ROUNDING = 1e-9  # metres


class ThingIndex:
    """An index of things, which do not change.

    Args:
        things: of a map.
    """

    def __init__(self, things: Sequence[Thing]) -> None:
        self._things = tuple(things)
        self._words = ThingWords(self._things)
        self._ranked: dict[tuple[str, ...], tuple[Answer, ...]] = {}
        self._groups: dict[tuple[tuple[str, ...] | None, float], Asked] = {}

    def thing(self, thing_id: str) -> Thing | None:
        """The thing that has an id, None where there is none."""
        row = self._words.row_of_id.get(thing_id)
        return None if row is None else self._things[row]

    def named(self, name: str) -> tuple[Thing, ...]:
        """Things that somebody gave this name; upper and lower case are the same, and so are runs of spaces."""
        return tuple(self._things[row] for row in self._words.rows_named(name))

    def names(self) -> tuple[str, ...]:
        """Every name that was given, as it was given."""
        return tuple(thing.name for thing in self._things if thing.name)

    def ranked(self, labels: Sequence[str], min_probability: float = 0.0) -> list[Answer]:
        """Things that may be one of the labels, likeliest first, equally likely ones by id; as `ObjectMap.find`.

        The probability is the sum of those of the labels, and at most that of existing. What cannot be one is left out.
        """
        key = _key(labels) or ()
        if key not in self._ranked:
            if len(self._ranked) >= KEPT_LABELS:
                del self._ranked[next(iter(self._ranked))]
            self._ranked[key] = self._rank(key)
        answers = self._ranked[key]
        if not min_probability > 0.0 or not answers or answers[-1].probability >= min_probability:
            return list(answers)
        return list(answers[: bisect_right(answers, -min_probability, key=lambda answer: -answer.probability)])

    def _rank(self, labels: tuple[str, ...]) -> tuple[Answer, ...]:
        rows, beliefs = self._beliefs(labels)
        known = zip(rows.tolist(), beliefs.tolist(), strict=True)
        answers = (Answer(self._things[row], p) for row, p in known if p > 0.0)
        return tuple(sorted(answers, key=lambda answer: (-answer.probability, answer.thing.id)))

    def near(
        self, origin: np.ndarray, label: Labels, count: int | None, min_probability: float
    ) -> list[tuple[Thing, float]]:
        """All things that are as near to (3,) `origin`, metres, as the `count`-th nearest, with their probability.

        Args:
            origin: map frame.
            label: things that are one, or one of several, with at least `min_probability`; None for those that exist
                with it.
            count: how many, more where several are equally far; None for all.
            min_probability: of being what was asked for; what cannot be that is left out whatever it is.

        Returns:
            Unsorted things with P(it is what was asked for).
        """
        asked = self._asked(label, min_probability)
        return self._with_probability(asked, asked.near(origin, count))

    def within(self, region: Box | Ball, label: Labels, min_probability: float) -> list[tuple[Thing, float]]:
        """All things that are what was asked for and have their centre in a region, with at least `min_probability`.

        Args:
            region: map frame.
            label, min_probability: as for `near`, but of being inside too.

        Returns:
            Unsorted things with P(it is what was asked for and its centre is inside).
        """
        asked = self._asked(label, min_probability)
        places = self._places_within(region, asked, min_probability)
        if len(places) == 0:
            return []
        probability = asked.probability[places]
        covariances = self._covariances(asked.rows[places])
        p = probability * inside_or_nan(region, asked.positions[places], covariances, min_probability / probability)
        found = np.flatnonzero((p >= min_probability) & (p > 0.0))  # what is NaN is too improbable
        rows = asked.rows[places[found]].tolist()
        return [(self._things[row], inside) for row, inside in zip(rows, p[found].tolist(), strict=True)]

    def over(
        self, region: Polygon, R_world_upright: np.ndarray, label: Labels, min_probability: float
    ) -> list[tuple[Thing, float]]:
        """Things that are what was asked for and may be over a polygon: all that are with at least `min_probability`,
        and some more.

        Args:
            region: in the upright frame.
            R_world_upright: (3, 3) axes of that frame.
            label, min_probability: as for `within`.

        Returns:
            Unsorted things with P(it is what was asked for), wherever it is.
        """
        asked = self._asked(label, min_probability)
        low, high = (
            np.append(region.corners.min(axis=0), region.low),
            np.append(region.corners.max(axis=0), region.high),
        )
        margin = _sigmas(min_probability) * self._widest + ROUNDING
        centre, radius = self._ball
        height = float(centre @ R_world_upright[:, 2])
        bounds = np.array([low - margin, high + margin])
        bounds[:, 2] = np.clip(bounds[:, 2], height - radius - ROUNDING, height + radius + ROUNDING)
        corners = np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(-1, 3) @ R_world_upright.T
        places = asked.in_box(corners.min(axis=0), corners.max(axis=0))
        upright = asked.positions[places] @ R_world_upright
        return self._with_probability(asked, places[np.all((upright >= bounds[0]) & (upright <= bounds[1]), axis=1)])

    def _places_within(self, region: Box | Ball, asked: Asked, min_probability: float) -> np.ndarray:
        """Places in `asked.rows` of all that may be inside with at least `min_probability`.

        Both regions are convex: with its mean at a distance d outside a face, a point is inside with Φ(-d / σ) at most.
        """
        sigmas = _sigmas(min_probability)
        low, high = _extent(region)
        places = asked.in_box(low - sigmas * self._widest - ROUNDING, high + sigmas * self._widest + ROUNDING)
        if sigmas:  # the widest of all may be far from here
            margin = sigmas * self._stds[asked.rows[places]] + ROUNDING
            position = asked.positions[places]
            places = places[np.all((position >= low - margin) & (position <= high + margin), axis=1)]
        return places

    def _asked(self, label: Labels, min_probability: float) -> Asked:
        labels = _key(label)
        key = labels, float(min_probability)
        asked = self._groups.pop(key, None)
        if asked is None:
            rows, beliefs = self._beliefs(labels)
            enough = (beliefs >= min_probability) & (beliefs > 0.0)
            rows = rows[enough]
            asked = Asked.of(rows, beliefs[enough], self._positions[rows])
        self._groups[key] = asked  # at the end: the first one is the one that was not asked for longest
        if len(self._groups) > KEPT_GROUPS:
            del self._groups[next(iter(self._groups))]
        return asked

    def _with_probability(self, asked: Asked, places: np.ndarray) -> list[tuple[Thing, float]]:
        rows, probability = asked.rows[places].tolist(), asked.probability[places].tolist()
        return [(self._things[row], p) for row, p in zip(rows, probability, strict=True)]

    def _beliefs(self, labels: tuple[str, ...] | None) -> tuple[np.ndarray, np.ndarray]:
        """(M,) places of things that may be one of the labels, and the probability of each; of all, that they exist."""
        if labels is None:
            return np.arange(len(self._things)), self._existence
        rows = sorted({row for label in labels for row in self._words.rows_by_label.get(label, ())})
        things = (self._things[row] for row in rows)
        beliefs = [min(sum(map(thing.belief, labels)), thing.existence) for thing in things]
        return np.array(rows, dtype=np.int64), np.array(beliefs, dtype=np.float64)

    def _covariances(self, rows: np.ndarray) -> np.ndarray:
        return np.array([self._things[row].position_covariance for row in rows.tolist()]).reshape(-1, 3, 3)

    @cached_property
    def _existence(self) -> np.ndarray:
        return np.array([thing.existence for thing in self._things])

    @cached_property
    def _positions(self) -> np.ndarray:
        return np.array([thing.position for thing in self._things]).reshape(-1, 3)

    @cached_property
    def _stds(self) -> np.ndarray:
        """(N, 3) metres along the map's axes."""
        return np.sqrt(np.maximum(np.einsum("nii->ni", self._covariances(np.arange(len(self._things)))), 0.0))

    @cached_property
    def _ball(self) -> tuple[np.ndarray, float]:
        """Centre (3,) and radius, metres, of a ball that holds all centres."""
        if not len(self._positions):
            return np.zeros(3), 0.0
        low, high = self._positions.min(axis=0), self._positions.max(axis=0)
        return (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0

    @cached_property
    def _widest(self) -> float:
        return float(self._stds.max(initial=0.0))


def _sigmas(min_probability: float) -> float:
    """Standard deviations outside a face up to which a point may be inside with that probability: Φ(-d / σ) at most."""
    from scipy.special import ndtri

    least = min_probability - INTEGRAL_ERROR
    return 0.0 if least >= 0.5 else FARTHEST if least <= 0.0 else min(float(-ndtri(least)), FARTHEST)


def _extent(region: Box | Ball) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of the axis-aligned box about a region."""
    if isinstance(region, Box):
        return region.low, region.high
    return region.centre - region.radius, region.centre + region.radius


def _key(label: Labels) -> tuple[str, ...] | None:
    """Labels in small letters, each once; None for things of any class."""
    if label is None:
        return None
    return tuple(dict.fromkeys(one.casefold() for one in ([label] if isinstance(label, str) else label)))
