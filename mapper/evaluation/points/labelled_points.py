"""The points of a map's cloud with the class that the map gives them and the class that they have.

A map's own labels are taken where it wrote them. Where it did not, a point belongs to the thing in whose box it lies,
the smallest first, and to the background if in none: boxes of believed things, wider and higher by `MARGIN`, as points
scatter about the surface that they were measured on, and `LIFT` above the support that they stand on. These labels are
coarse: what stands beside a round thing is in the corners of its box.

The true class of a point is that of the nearest true point, once the clouds are aligned. Points of the map without a
true one nearby cannot be judged; they are left out and counted. The papers label clouds that are given; a map makes its
own, and could leave out what is hard: so the share of the objects' true points that have a point of the map nearby is
told as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial import KDTree

from ....datasets.truth import NO_OBJECT
from ...map.boxes import inside_box
from ..inputs.case import Case, PlacedThing
from ..result import NotEvaluated
from ..things.matching import believed

MARGIN = 0.005  # m: half a voxel of the cloud (`CloudConfig`)
LIFT = 0.0005  # m: the plane on which a thing stands is not the thing


@dataclass(frozen=True, slots=True, eq=False)
class LabelledPoints:
    """N points of the map that can be judged.

    Attributes:
        found: (N,) class that the map gives, index into the truth's classes; `NO_OBJECT` for background.
        true: (N,) class that the point has, the same way.
        left_out: points of the map that are far from all true ones.
        covered: share of the true points of objects that have a point of the map nearby; None without any.
        by_run: whether the labels are the run's own.
    """

    found: np.ndarray
    true: np.ndarray
    left_out: int
    covered: float | None
    by_run: bool

    def notes(self, max_distance: float) -> tuple[str, ...]:
        """What a reader of numbers from these points must know; `max_distance` is metres."""
        box = f"boxes of believed things, {1000.0 * MARGIN:.0f} mm wider on all sides but the bottom"
        share = f"{self.left_out} of {self.left_out + len(self.true)} points of the map left out"
        return (
            f"Labels of points: {'as the run wrote them' if self.by_run else box}.",
            f"{share}: farther than {100.0 * max_distance:g} cm from any labelled true point.",
        )


@lru_cache(maxsize=1)  # two protocols ask, and clouds are large
def label_points(case: Case) -> LabelledPoints:
    """Labels of the map's cloud beside the true ones.

    Raises:
        InputError: the cloud of the map is damaged.
        NotEvaluated: there is no labelled true cloud, no cloud of the map, or no point in common.
    """
    if case.truth.point_truth is None:
        raise NotEvaluated("the truth has no labelled points")
    points, labels = case.run.cloud()
    true, placed = case.truth.point_truth(), case.alignment.apply(points)
    near = _nearest(placed, true.points, case.config.point_distance)
    judged = near < len(true.points)
    if not np.any(judged):
        distance = f"{100.0 * case.config.point_distance:g} cm"
        raise NotEvaluated(f"none of the {len(points)} points of the map is within {distance} of a labelled true point")
    found = _by_boxes(case, points[judged]) if labels is None else _in_truth_classes(case, labels[judged])
    wanted = true.points[true.class_id != NO_OBJECT]
    has_point = _nearest(wanted, placed, case.config.point_distance) < len(placed)
    covered = float(np.mean(has_point)) if len(wanted) else None
    return LabelledPoints(found, true.class_id[near[judged]], int(np.sum(~judged)), covered, labels is not None)


def _nearest(points: np.ndarray, true_points: np.ndarray, max_distance: float) -> np.ndarray:
    """(M,) rows of the nearest of P true points; P where none is near enough."""
    if len(true_points) == 0:
        return np.zeros(len(points), dtype=np.int64)
    _, rows = KDTree(true_points).query(points, distance_upper_bound=max_distance)
    return np.asarray(rows, dtype=np.int64)


def _in_truth_classes(case: Case, labels: np.ndarray) -> np.ndarray:
    """Indices into the map's classes as indices into the truth's; classes unknown to the truth are background."""
    meant = [case.to_truth_label(name) for name in case.run.object_map.classes]
    codes = [NO_OBJECT if label is None else case.truth.classes.index(label) for label in meant]
    return np.array([*codes, NO_OBJECT], dtype=np.int64)[labels]  # the last for `NO_OBJECT`, which is -1


def _by_boxes(case: Case, points: np.ndarray) -> np.ndarray:
    """(N,) classes of (N, 3) points of the map's frame by the boxes of believed things, the smallest first."""
    R_world_upright = case.run.object_map.R_world_upright
    found = np.full(len(points), NO_OBJECT, dtype=np.int64)
    for placed in _largest_first(believed(case)):
        inside = _in_wider_box(points, placed, R_world_upright)
        found[inside] = case.truth.classes.index(placed.label)
    return found


def _largest_first(things: Sequence[PlacedThing]) -> list[PlacedThing]:
    """So that smaller ones write over them; equal ones by their names, so that the order of a map does not matter."""
    return sorted(things, key=lambda placed: (-float(np.prod(placed.thing.size)), placed.thing.id))


def _in_wider_box(points: np.ndarray, placed: PlacedThing, R_world_upright: np.ndarray) -> np.ndarray:
    """(N,) bool: in the box of a thing, wider by `MARGIN` at its sides and top, its bottom higher by `LIFT`."""
    thing = placed.thing
    position = thing.position + (MARGIN + LIFT) / 2.0 * R_world_upright[:, 2]
    size = thing.size + np.array([2.0 * MARGIN, 2.0 * MARGIN, MARGIN - LIFT])
    return inside_box(points, position, size, thing.yaw, R_world_upright)
