"""The cloud that all true depth images make together, each point with the thing it belongs to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...frame import Intrinsics
from ...truth import NO_OBJECT, PointTruth, TrueObject
from .casting import MISS, hit_depths
from .render import Renderer
from .surfaces import Surfaces

VOXEL = 0.01  # metres a side
VIEWS = 200  # at most; views are spread evenly over the sequence
WIDTH = 320  # pixels at most; coarser than the frames, the voxels are coarser still
PENDING = 1_000_000  # points gathered before they are merged: bounds the memory
ID_BITS, AXIS_BITS = 12, 17  # of a key: up to 4094 things, voxels to 655 m from the origin


@dataclass(frozen=True, slots=True, eq=False)
class _Votes:
    """Points by voxel and thing.

    Attributes:
        key: (K,) int64, growing: voxel and, in the last `ID_BITS`, the thing.
        count: (K,) int64 points.
        total: (K, 3) sums of their coordinates, metres.
    """

    key: np.ndarray
    count: np.ndarray
    total: np.ndarray


def labelled_cloud(
    renderer: Renderer,
    surfaces: Surfaces,
    intrinsics: Intrinsics,
    poses: np.ndarray,
    objects: tuple[TrueObject, ...],
    classes: tuple[str, ...],
    reach: tuple[float, float],
) -> PointTruth:
    """One point for every voxel that is seen: the mean of the thing that has most points in it.

    Args:
        renderer: of the surfaces.
        surfaces: the scene; owners that are no object's id count as `NO_OBJECT`.
        intrinsics: of the frames.
        poses: (N, 4, 4) `T_world_camera`; every n-th is used, so that there are `VIEWS` at most.
        objects: whose points are labelled.
        classes: that `class_id` indexes.
        reach: least and greatest depth that counts, metres.
    """
    camera = _reduced(intrinsics)
    labels = _by_owner(surfaces, objects)
    pending: list[_Votes] = []
    for pose in poses[:: -(-len(poses) // VIEWS)]:
        cast = renderer.cast(camera, pose)
        eye = np.ascontiguousarray(pose[:3, 3], np.float64)
        depth = hit_depths(surfaces.corners, cast.triangle, eye, cast.directions)
        there = (cast.triangle != MISS) & (depth >= reach[0]) & (depth <= reach[1])
        points = eye + depth[there, None] * cast.directions[there]
        pending.append(_merged([_votes(points, labels[surfaces.owner[cast.triangle[there]]])]))
        if sum(len(votes.key) for votes in pending[1:]) > PENDING:
            pending = [_merged(pending)]
    return _elected(_merged(pending), objects, classes)


def _reduced(intrinsics: Intrinsics) -> Intrinsics:
    """The same field of view with `WIDTH` pixels at most."""
    s = min(WIDTH / intrinsics.width, 1.0)
    size = round(s * intrinsics.width), round(s * intrinsics.height)
    centre = s * (intrinsics.cx + 0.5) - 0.5, s * (intrinsics.cy + 0.5) - 0.5
    return Intrinsics(*size, s * intrinsics.fx, s * intrinsics.fy, *centre)


def _by_owner(surfaces: Surfaces, objects: tuple[TrueObject, ...]) -> np.ndarray:
    """Label by owner: the row of the object plus 1, else 0; an owner of -1 finds the last entry, 0."""
    greatest = max(int(surfaces.owner.max(initial=-1)), *(thing.id for thing in objects), -1)
    labels = np.zeros(greatest + 2, np.int64)
    for row, thing in enumerate(objects):
        labels[thing.id] = row + 1
    return labels


def _votes(points: np.ndarray, label: np.ndarray) -> _Votes:
    """One vote a point; (N, 3) metres and (N,) labels, in any order."""
    i, j, k = (np.floor(points / VOXEL).astype(np.int64) + (1 << (AXIS_BITS - 1))).T
    key = (((i << AXIS_BITS | j) << AXIS_BITS | k) << ID_BITS) | label
    return _Votes(key, np.ones(len(key), np.int64), points)


def _merged(several: list[_Votes]) -> _Votes:
    """Votes for the same voxel and thing added up."""
    key = np.concatenate([votes.key for votes in several])
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))  # keys are not negative
    if not len(first):
        return _Votes(key, np.zeros(0, np.int64), np.zeros((0, 3)))
    count = np.concatenate([votes.count for votes in several])[order]
    total = np.concatenate([votes.total for votes in several])[order]
    return _Votes(key[first], np.add.reduceat(count, first), np.add.reduceat(total, first))


def _elected(votes: _Votes, objects: tuple[TrueObject, ...], classes: tuple[str, ...]) -> PointTruth:
    """The thing with most points of every voxel; of equal ones the room before objects, in their order."""
    voxel = votes.key >> ID_BITS
    order = np.lexsort((-votes.count, voxel))
    best = order[np.flatnonzero(np.diff(voxel[order], prepend=-1))]
    row = votes.key[best] & ((1 << ID_BITS) - 1)
    ids = np.array([NO_OBJECT, *(thing.id for thing in objects)], np.int64)
    class_ids = np.array([NO_OBJECT, *(classes.index(thing.label) for thing in objects)], np.int64)
    points = (votes.total[best] / votes.count[best, None]).astype(np.float32)
    return PointTruth(points, class_ids[row], ids[row])
