"""Checks of a map against objects that are known to be in the place, and against known false detections.

The file is in the world of the pose files; `thingmap.datasets.truth_json` describes its form. Not every object of the
place need be listed, so what is further away than the tolerances is not judged.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thingmap.datasets import truth_json
from thingmap.mapper.evaluation.inputs.case import Alignment
from thingmap.mapper.map.thing import Thing

MIN_EXISTENCE = 0.9  # of a thing that stands for a listed object
BELIEVED = 0.5  # existence times probability of the class from which a map claims that there is such an object


@dataclass(frozen=True, slots=True, eq=False)
class KnownObject:
    """An object of the place, or with `is_false` one that a detector sees there and that is none.

    Attributes:
        name: for people.
        label: its class.
        position: (3,) metres, world of the pose files.
        tolerance: metres.
        is_false: whether nothing of this class is there.
    """

    name: str
    label: str
    position: np.ndarray
    tolerance: float
    is_false: bool


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """One verdict.

    Attributes:
        known: what was looked for.
        matches: things believed to be of its class within the tolerance, each counted for the object nearest to it.
        nearest: the best candidate there is, with any existence; None without one within 1 m.
        distance: metres to `nearest`.
        passed: exactly one match, existing with `MIN_EXISTENCE`; for a false detection, none.
    """

    known: KnownObject
    matches: tuple[Thing, ...]
    nearest: Thing | None
    distance: float
    passed: bool


def read_known_objects(path: Path) -> list[KnownObject]:
    """Objects, then false detections.

    Raises:
        InputError: for a missing file or one that is not of the form.
    """
    content = truth_json.read_known_objects(path)
    both = (content.objects, False), (content.false_detections, True)
    return [
        KnownObject(item.name, item.thing.label, item.thing.position, item.tolerance, is_false)
        for items, is_false in both
        for item in items
    ]


def check_things(things: tuple[Thing, ...], known: list[KnownObject], alignment: Alignment) -> list[Check]:
    """One verdict for every known object; `alignment` takes the map's axes to the world of the pose files."""
    positions = alignment.apply(np.array([thing.position for thing in things]).reshape(-1, 3))
    apart = np.array([np.linalg.norm(positions - item.position, axis=1) for item in known]).reshape(len(known), -1)
    belief = np.array([[thing.belief(item.label) for thing in things] for item in known]).reshape(apart.shape)
    tolerance = np.array([item.tolerance for item in known])
    claims = (belief >= BELIEVED) & (apart <= tolerance[:, None])
    checks = []
    for i, item in enumerate(known):
        rivals = [j for j, other in enumerate(known) if other.label == item.label and not other.is_false]
        mine = np.flatnonzero(claims[i])
        if not item.is_false:
            distances = np.where(claims[rivals], apart[rivals], np.inf)
            mine = np.array([k for k in mine if rivals[int(np.argmin(distances[:, k]))] == i], dtype=int)
        matches = tuple(things[k] for k in mine)
        found = len(matches) == 1 and matches[0].label == item.label and matches[0].existence >= MIN_EXISTENCE
        nearest = _best(belief[i], apart[i], item.tolerance)
        checks.append(
            Check(
                known=item,
                matches=matches,
                nearest=None if nearest is None else things[nearest],
                distance=float("nan") if nearest is None else float(apart[i, nearest]),
                passed=not matches if item.is_false else found,
            )
        )
    return checks


def _best(belief: np.ndarray, apart: np.ndarray, tolerance: float) -> int | None:
    """The thing with the most belief within the tolerance; without one, the nearest that may be of the class."""
    near = np.flatnonzero((apart <= tolerance) & (belief > 0.01))
    if len(near):
        return int(near[np.argmax(belief[near])])
    far = np.flatnonzero((apart <= 1.0) & (belief >= 0.1))
    return int(far[np.argmin(apart[far])]) if len(far) else None
