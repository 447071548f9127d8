"""Which thing of the map is which true object: one to one, whatever they are called.

A pair is allowed where the centres are within the object's reach (or the volumes overlap enough). Of all assignments
of allowed pairs those with the most pairs are best, and among them the one with the least sum of distances (or of
1 - IoU): the linear assignment problem of Kuhn (1955).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from ....datasets.ground_truth import GroundTruth
from ....datasets.truth import TrueObject
from ..inputs.case import Case, PlacedThing
from .volume_iou import box_rows, volume_ious


@dataclass(frozen=True, slots=True, eq=False)
class Matching:
    """Things with the objects they stand for.

    Attributes:
        things: N claims of the map.
        objects: M true objects.
        counted: (M,) bool, objects that must be found; the others may be, and are then nobody's merit.
        pairs: (K, 2) rows of `things` and `objects`, by growing row of `things`; no row occurs twice.
        distance: (N, M) metres between centres.
        reach: (M,) metres, how far from an object a thing may be that stands for it.
    """

    things: tuple[PlacedThing, ...]
    objects: tuple[TrueObject, ...]
    counted: np.ndarray
    pairs: np.ndarray
    distance: np.ndarray
    reach: np.ndarray

    @property
    def matched(self) -> list[tuple[PlacedThing, TrueObject]]:
        """Pairs whose object counts."""
        return [(self.things[i], self.objects[j]) for i, j in self.pairs if self.counted[j]]

    @property
    def claims(self) -> list[PlacedThing]:
        """Things that count: all but those that stand for an object that does not."""
        ignored = {int(i) for i, j in self.pairs if not self.counted[j]}
        return [thing for i, thing in enumerate(self.things) if i not in ignored]

    @property
    def false_positives(self) -> list[PlacedThing]:
        """Things that stand for nothing."""
        paired = set(self.pairs[:, 0].tolist())
        return [thing for i, thing in enumerate(self.things) if i not in paired]

    @property
    def missed(self) -> list[TrueObject]:
        """Objects that count and that no thing stands for."""
        paired = set(self.pairs[:, 1].tolist())
        return [true for j, true in enumerate(self.objects) if self.counted[j] and j not in paired]

    @property
    def wanted(self) -> list[TrueObject]:
        """Objects that count."""
        return [true for true, counts in zip(self.objects, self.counted, strict=True) if counts]

    @property
    def duplicates(self) -> list[PlacedThing]:
        """Things that stand for nothing, within reach of an object that counts and has its thing already."""
        taken = [j for _, j in self.pairs if self.counted[j]]
        near = np.any(self.distance[:, taken] <= self.reach[taken], axis=1)
        near[self.pairs[:, 0]] = False
        return [thing for thing, is_near in zip(self.things, near, strict=True) if is_near]


def same_label(a: str, b: str) -> bool:
    """Whether two labels are the same but for upper and lower case."""
    return a.casefold() == b.casefold()


def places_all(truth: GroundTruth) -> bool:
    """Whether the truth knows where every object is, so that a thing on none of them is false; not without objects."""
    return truth.complete and 0 < len(truth.located) == len(truth.objects)


def believed(case: Case) -> tuple[PlacedThing, ...]:
    """Things that the map claims: existence times probability of the class is at least `believed`."""
    return tuple(thing for thing in case.things if thing.belief >= case.config.believed)


def reaches(case: Case) -> np.ndarray:
    """(M,) metres within which a thing may stand for each located object.

    That is a share of its diagonal, or its tolerance where that is more: a tolerance says how well the truth is known,
    and not how well a map must be. Of unknown size, it is the tolerance, or a fixed distance without one.
    """
    config, result = case.config, []
    for true in case.truth.located:
        diagonal, tolerance = float(np.linalg.norm(true.size)), case.truth.tolerance.get(true.id)
        if diagonal > 0.0:
            result.append(max(config.distance_share * diagonal, tolerance or 0.0))
        else:  # NaN where the size is unknown
            result.append(config.max_distance if tolerance is None else tolerance)
    return np.array(result)


def assign(cost: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """One-to-one assignment with the most allowed pairs and, among those, the least cost.

    Args:
        cost: (N, M) finite and >= 0 where allowed.
        allowed: (N, M) bool.

    Returns:
        (K, 2) int64 rows and columns, by growing row.
    """
    if not np.any(allowed):
        return np.zeros((0, 2), dtype=np.int64)
    forbidden = 1.0 + min(cost.shape) * float(np.max(cost[allowed]))  # dearer than all that could be saved
    rows, columns = linear_sum_assignment(np.where(allowed, cost, forbidden))
    kept = allowed[rows, columns]
    return np.stack([rows[kept], columns[kept]], axis=1).astype(np.int64)


def match_by_distance(case: Case, things: Sequence[PlacedThing], counted: np.ndarray) -> Matching:
    """Matching of things with the located objects, (M,) `counted` or not, by distance of centres."""
    distance, reach = _distances(things, case.truth.located), reaches(case)
    pairs = assign(distance, distance <= reach)
    return Matching(tuple(things), case.truth.located, counted, pairs, distance, reach)


def match_by_volume(case: Case, things: Sequence[PlacedThing], counted: np.ndarray, min_iou: float) -> Matching:
    """The same by intersection over union of volumes; objects without a size match nothing."""
    objects = case.truth.located
    iou = volume_ious(rows_of_things(things, case), rows_of_objects(objects, case))
    pairs = assign(1.0 - iou, iou >= min_iou)  # NaN is not >= anything
    return Matching(tuple(things), objects, counted, pairs, _distances(things, objects), reaches(case))


def match_ranked(case: Case) -> Matching:
    """Matching of all things, whatever their existence, with all located objects, all of which count.

    The likeliest thing chooses first, and takes the nearest free object in reach: so a doubtful thing never takes the
    object of one that is sure (Everingham et al., PASCAL VOC, treat detections so).
    """
    objects = case.truth.located
    distance, reach = _distances(case.things, objects), reaches(case)
    free = np.where(distance <= reach, distance, np.inf)
    pairs = []
    for i in sorted(range(len(case.things)), key=lambda i: (-case.things[i].thing.existence, case.things[i].thing.id)):
        if np.isfinite(free[i]).any():
            j = int(np.argmin(free[i]))
            pairs.append((i, j))
            free[:, j] = np.inf
    rows = np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)
    return Matching(case.things, objects, np.ones(len(objects), dtype=bool), rows, distance, reach)


def rows_of_things(things: Sequence[PlacedThing], case: Case) -> np.ndarray:
    """(N, 7) boxes for `volume_ious`."""
    return box_rows([(thing.position, thing.thing.size, thing.yaw) for thing in things], case.R_truth_upright)


def rows_of_objects(objects: Sequence[TrueObject], case: Case) -> np.ndarray:
    """(M, 7) boxes for `volume_ious`, NaN where a size is unknown."""
    return box_rows([(true.position, true.size, true.yaw) for true in objects], case.R_truth_upright)


def _distances(things: Sequence[PlacedThing], objects: Sequence[TrueObject]) -> np.ndarray:
    """(N, M) metres between centres."""
    a = np.array([thing.position for thing in things]).reshape(-1, 1, 3)
    b = np.array([true.position for true in objects]).reshape(1, -1, 3)
    return np.linalg.norm(a - b, axis=2)
