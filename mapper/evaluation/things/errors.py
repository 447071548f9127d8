"""How far things are from the objects they stand for: centres, sizes and volumes.

Sizes are compared in two ways, as the map and the truth may name the axes of a box differently:
- *sorted*: the longer horizontal extent with the longer, the shorter with the shorter, height with height. No yaw
  takes part, so a long object standing askew to a map that knows no yaw costs what its box is too wide.
- *in the truth's axes*: the extents of the thing's box along the object's own axes, |cos d| a + |sin d| b for
  horizontal extents a and b and a difference d of yaw. A wrong yaw shows here, even if all extents are right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....datasets.truth import TrueObject
from ..inputs.case import Case, PlacedThing
from .matching import rows_of_objects, rows_of_things
from .volume_iou import volume_iou

EXTENTS = ("longer side", "shorter side", "height")  # of sizes compared sorted


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Errors of K matched pairs.

    Attributes:
        centre: (K, 3) metres, thing minus object along the truth's axes.
        size: (K, 3) metres, thing minus object, extents sorted as in `EXTENTS`; NaN where the object's is unknown.
        log_size: (K, 3) natural logarithm of thing over object, the same extents.
        log_own_size: (K, 3) the same with extents along the object's own axes.
        iou: (K,) intersection over union of volumes, NaN where the object's size is unknown.
    """

    centre: np.ndarray
    size: np.ndarray
    log_size: np.ndarray
    log_own_size: np.ndarray
    iou: np.ndarray

    @property
    def distance(self) -> np.ndarray:
        """(K,) metres between centres."""
        return np.linalg.norm(self.centre, axis=1)


def measure_errors(case: Case, pairs: Sequence[tuple[PlacedThing, TrueObject]]) -> Errors:
    """Errors of every pair."""
    things, objects = [thing for thing, _ in pairs], [true for _, true in pairs]
    centre = np.array([thing.position - true.position for thing, true in pairs]).reshape(-1, 3)
    size = np.array([in_sorted_order(thing.thing.size, thing.thing.size) for thing in things]).reshape(-1, 3)
    own = np.array([extents_along(thing.thing.size, thing.yaw - true.yaw) for thing, true in pairs]).reshape(-1, 3)
    true_own = np.array([true.size for true in objects]).reshape(-1, 3)
    true_size = np.array([in_sorted_order(true.size, true.size) for true in objects]).reshape(-1, 3)
    with np.errstate(divide="ignore"):  # a thing without extent is wrong by infinity
        log_size, log_own_size = np.log(size / true_size), np.log(own / true_own)
    boxes = zip(rows_of_things(things, case), rows_of_objects(objects, case), strict=True)
    iou = np.array([volume_iou(thing, true) for thing, true in boxes])
    return Errors(centre, size - true_size, log_size, log_own_size, iou)


def in_sorted_order(values: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(3,) values that belong to the extents `size` (3,), in the order longer side, shorter side, height."""
    return np.asarray(values, dtype=np.float64)[[1, 0, 2] if size[1] > size[0] else [0, 1, 2]]


def extents_along(size: np.ndarray, yaw: float) -> np.ndarray:
    """(3,) extents of an upright box of `size` (3,), turned by `yaw` radians, along axes that are not turned."""
    cosine, sine = abs(np.cos(yaw)), abs(np.sin(yaw))
    return np.array([cosine * size[0] + sine * size[1], sine * size[0] + cosine * size[1], size[2]])
