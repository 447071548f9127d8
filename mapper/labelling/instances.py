"""Labelled voxels become the points of the map's things.

    labels -> segments (connected, of one class) -> those that a thing's volume explains are its own
           -> where several things explain one segment, each voxel is the nearest volume's

What does not fit is reported: things without points, segments without a thing, and sizes that the points contradict.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from ...datasets.truth import NO_OBJECT
from ..map.boxes import box_axes
from ..map.object_map import ObjectMap
from ..map.thing import Thing
from .instance_config import InstanceConfig
from .labelling import Labels
from .labelling_config import LabellingConfig
from .neighbours import neighbour_pairs
from .segment_box import SegmentBox, fit_box
from .segment_size import SizeCheck, check_box, check_size
from .voxels import Voxels

NONE = 0  # number of a voxel that is no thing's


@dataclass(frozen=True, slots=True, eq=False)
class ThingPoints:
    """What labelling says of a thing.

    Attributes:
        id: of the thing.
        points: how many are its own.
        size: what they say of its size, along the axes of `box` where there is one; None for too few to say anything.
        box: that they lie on, in the map's upright frame; None for what is round, or seen from too few sides.
    """

    id: str
    points: int
    size: SizeCheck | None
    box: SegmentBox | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LooseSegment:
    """Voxels that hang together and that no thing explains: their `label`, the number of `points`, and the middle
    `position`, (3,) metres, map frame."""

    label: str
    points: int
    position: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Instances:
    """Whose the voxels are.

    Attributes:
        number: (N,) int32, t + 1 for the map's thing t, `NONE` for none.
        things: for each thing of the map, in its order.
        loose: segments without a thing, the largest first; only those of as many voxels as one must share with a thing.
    """

    number: np.ndarray
    things: tuple[ThingPoints, ...]
    loose: tuple[LooseSegment, ...]


def find_instances(
    voxels: Voxels, labels: Labels, object_map: ObjectMap, config: LabellingConfig | None = None
) -> Instances:
    """Split labelled voxels into the map's things.

    Args:
        voxels: N, in the map's frame.
        labels: of them, indices into the map's classes.
        object_map: the things.
        config: numbers, the size of voxels among them; the defaults where not given.
    """
    config = config or LabellingConfig()
    rows = np.flatnonzero(labels.label != NO_OBJECT)
    label, points = labels.label[rows], voxels.points[rows]
    segment = segments_of(voxels.cells[rows], label)
    owner, explained = _owners(points, label, segment, object_map, config)
    number = np.full(len(voxels), NONE, dtype=np.int32)
    number[rows] = owner + 1
    things = []
    for t, thing in enumerate(object_map.things):
        things.append(_say_of(thing, points[owner == t], object_map, config))
    loose = _loose(points, label, segment, explained, object_map.classes, config.instances)
    return Instances(number, tuple(things), loose)


def _say_of(thing: Thing, own: np.ndarray, object_map: ObjectMap, config: LabellingConfig) -> ThingPoints:
    """What a thing's own (M, 3) points say of it."""
    voxel, numbers = config.voxels.voxel_size, config.instances
    box = fit_box(own @ object_map.R_world_upright, voxel, config.boxes)
    size = None if box is None else check_box(box, thing, numbers, config.boxes)
    if size is not None:
        return ThingPoints(thing.id, len(own), size, box)
    return ThingPoints(thing.id, len(own), check_size(_in_box(own, thing, object_map), thing, voxel, numbers))


def segments_of(cells: np.ndarray, label: np.ndarray) -> np.ndarray:
    """(N,) int32 number of each voxel's segment: voxels of one label that touch, at a face, an edge or a corner.

    Args:
        cells: (N, 3) integers, each once.
        label: (N,).
    """
    pairs = neighbour_pairs(cells)
    pairs = pairs[label[pairs[:, 0]] == label[pairs[:, 1]]]
    graph = coo_array((np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
    return connected_components(graph, directed=False)[1]


def _owners(
    points: np.ndarray, label: np.ndarray, segment: np.ndarray, object_map: ObjectMap, config: LabellingConfig
) -> tuple[np.ndarray, np.ndarray]:
    """(L,) index of each voxel's thing, -1 for none; and for each segment whether a thing explains it.

    A point is as far from a volume as from the farthest of its sides that it is beyond; inside, that is negative.
    """
    nearest = np.full(len(points), np.inf)
    owner = np.full(len(points), -1, dtype=np.int32)
    explained = np.zeros(segment.max(initial=-1) + 1, dtype=bool)
    if len(points) == 0:
        return owner, explained
    tree, numbers, count = KDTree(points), config.instances, np.bincount(segment)
    for t, thing in enumerate(object_map.things):
        beliefs = np.array([thing.belief(name) for name in object_map.classes])
        reach = numbers.reach * float(thing.size.max())
        margin = numbers.margin * _side_std(thing, object_map, config.voxels.voxel_size)
        limit = max(reach, float(margin.max()))
        radius = float(np.linalg.norm(thing.size / 2.0 + limit))
        rows = np.array(tree.query_ball_point(thing.position, radius), dtype=np.intp)
        rows = rows[beliefs[label[rows]] >= numbers.least_belief]
        outside = np.abs(_in_box(points[rows], thing, object_map)) - thing.size / 2.0
        found, inside = np.unique(segment[rows[(outside <= margin).all(axis=1)]], return_counts=True)
        own = found[inside >= np.minimum(numbers.least_points, count[found])]
        explained[own] = True
        distance = outside.max(axis=1)
        is_nearer = np.isin(segment[rows], own) & (distance <= limit)
        is_nearer &= distance < nearest[rows]
        owner[rows[is_nearer]] = t
        nearest[rows[is_nearer]] = distance[is_nearer]
    return owner, explained


def _in_box(points: np.ndarray, thing: Thing, object_map: ObjectMap) -> np.ndarray:
    """(M, 3) of (M, 3) points along the axes of the thing's box, from its centre."""
    return (points - thing.position) @ box_axes(thing.yaw, object_map.R_world_upright)


def _side_std(thing: Thing, object_map: ObjectMap, voxel: float) -> np.ndarray:
    """(3,) metres: how far off the box's sides may be, by its centre, its size, and half a voxel."""
    axes = box_axes(thing.yaw, object_map.R_world_upright)
    variance = np.einsum("ij,ik,kj->j", axes, thing.position_covariance, axes)
    return np.sqrt(np.maximum(variance, 0.0) + (thing.size_std / 2.0) ** 2) + voxel / 2.0


def _loose(
    points: np.ndarray,
    label: np.ndarray,
    segment: np.ndarray,
    explained: np.ndarray,
    classes: tuple[str, ...],
    config: InstanceConfig,
) -> tuple[LooseSegment, ...]:
    count = np.bincount(segment, minlength=len(explained))
    numbers = np.flatnonzero(~explained & (count >= config.least_points))
    loose = []
    for s in numbers[np.argsort(-count[numbers], kind="stable")]:
        own = segment == s
        name = classes[label[np.argmax(own)]]
        loose.append(LooseSegment(name, int(count[s]), np.median(points[own], axis=0)))
    return tuple(loose)
