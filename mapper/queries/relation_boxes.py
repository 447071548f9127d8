"""Volumes of things as arrays in the upright frame, and one of them seen from another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..map.thing import Thing
from ..map.up_direction import UpDirection
from ..map.upright import upright_rotation
from .synonyms import Words, normal_words, synonyms

LEAST_VARIANCE = 1e-12  # m^2: a micrometre, so that a position without uncertainty still has a Cholesky factor


@dataclass(frozen=True, slots=True, eq=False)
class UprightBoxes:
    """The volumes of N things, z being up.

    Attributes:
        centre: (N, 3) metres.
        covariance: (N, 3, 3) of `centre`, m^2.
        size: (N, 3) full extents along each box's own axes, metres; the third is the height.
        size_std: (N, 3) of `size`, metres.
        axis: (N, 2) cosine and sine of each yaw; a map says nothing of its uncertainty.
        existence: (N,) P(it exists).
        on_legs: (N,) P(it is of a class whose box is hollow below a flat top, such as a table | it exists).
        on_floor: (N,) P(it is of a class that stands on the floor, such as a chair | it exists).
        tilt_std: radians, of the direction of up: it lifts a point by so much for each metre aside.
    """

    centre: np.ndarray
    covariance: np.ndarray
    size: np.ndarray
    size_std: np.ndarray
    axis: np.ndarray
    existence: np.ndarray
    on_legs: np.ndarray
    on_floor: np.ndarray
    tilt_std: float

    def __len__(self) -> int:
        return len(self.centre)


@lru_cache(maxsize=1)  # things and directions are told apart by identity: the next question to the same map is quick
def upright_boxes(things: tuple[Thing, ...], up: UpDirection) -> UprightBoxes:
    """The volumes of things of a map in which `up` is up."""
    R = upright_rotation(up.direction)
    shape, known = (len(things), 3), synonyms()
    yaw = np.array([thing.yaw for thing in things], dtype=np.float64)
    covariance = np.array([thing.position_covariance for thing in things], dtype=np.float64).reshape(*shape, 3)
    return UprightBoxes(
        centre=np.array([thing.position for thing in things], dtype=np.float64).reshape(shape) @ R,
        covariance=R.T @ covariance @ R,
        size=np.array([thing.size for thing in things], dtype=np.float64).reshape(shape),
        size_std=np.array([thing.size_std for thing in things], dtype=np.float64).reshape(shape),
        axis=np.stack([np.cos(yaw), np.sin(yaw)], axis=1),
        existence=np.array([thing.existence for thing in things], dtype=np.float64),
        on_legs=_share(things, known.flat_topped),
        on_floor=_share(things, known.on_floor),
        tilt_std=up.std_rad,
    )


def _share(things: tuple[Thing, ...], phrases: frozenset[Words]) -> np.ndarray:
    """(N,) P(a thing is of a class among `phrases` | it exists)."""
    labels = {label for thing in things for label in thing.class_posterior}
    wanted = sorted(label for label in labels if normal_words(label) in phrases)
    shares = [sum(thing.class_posterior.get(label, 0.0) for label in wanted) for thing in things]
    return np.minimum(np.array(shares, dtype=np.float64), 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """P ordered pairs of boxes; everything is in the axes of the second box, whose centre is the origin.

    The errors of the two are taken as independent. In a map they are not: both hang on the same camera poses, so
    neighbours err together and their distance is better known than this says. Answers are therefore too cautious
    rather than too sure.

    Attributes:
        boxes: that the indices count.
        first, second: (P,) indices.
        mean: (P, 3) centre of the first, metres.
        covariance: (P, 3, 3) of `mean`: that of both centres, and of the tilt of up over the distance between them.
        turn: (P, 2) cosine and sine of the yaw of the first.
    """

    boxes: UprightBoxes
    first: np.ndarray
    second: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray
    turn: np.ndarray

    @classmethod
    def of(cls, boxes: UprightBoxes, first: np.ndarray, second: np.ndarray) -> Pairs:
        """Pairs of `boxes` with these indices, (P,) each."""
        cosine, sine = boxes.axis[second].T
        R = np.zeros((len(first), 3, 3))  # R_second_upright
        R[:, 0, 0], R[:, 0, 1], R[:, 1, 0], R[:, 1, 1], R[:, 2, 2] = cosine, sine, -sine, cosine, 1.0
        mean = np.einsum("pij,pj->pi", R, boxes.centre[first] - boxes.centre[second])
        covariance = R @ (boxes.covariance[first] + boxes.covariance[second]) @ R.transpose(0, 2, 1)
        covariance[:, 2, 2] += boxes.tilt_std**2 * np.sum(mean[:, :2] ** 2, axis=1)
        covariance += LEAST_VARIANCE * np.eye(3)
        turn = np.einsum("pij,pj->pi", R[:, :2, :2], boxes.axis[first])
        return cls(boxes, first, second, mean, covariance, turn)

    def __len__(self) -> int:
        return len(self.first)

    @property
    def both_exist(self) -> np.ndarray:
        """(P,) P(both things exist), as if independent."""
        return self.boxes.existence[self.first] * self.boxes.existence[self.second]

    @property
    def sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """(P, 3) sizes of the first and of the second, metres."""
        return self.boxes.size[self.first], self.boxes.size[self.second]

    @property
    def size_stds(self) -> tuple[np.ndarray, np.ndarray]:
        """(P, 3) standard deviations of `sizes`, metres."""
        return self.boxes.size_std[self.first], self.boxes.size_std[self.second]
