"""Landmarks into which two things went, because the camera's pose was wrong while it saw the second.

A camera that has drifted takes what it sees for what it knows at that place. Once a loop is closed, such measurements
hold the poses where they were: each says that the second thing is where the first is. The camera's own measurements
(odometry, features, depth, closures) know nothing of things. Under the poses that these make by themselves
(`pose_graph.solve_poses`), the centres that were measured of the one landmark lie at two places: they fall into
clusters, connected by what agrees within its noise. The oldest cluster is what the landmark is; what becomes of the
others is in `separation.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from ..config import LifecycleConfig
from ..trajectory.rigid import chi_square, inverse
from .landmarks import Landmark
from .records import DepthCentre, Loop
from .smoother import Smoother

OBEYED = 22.46  # chi-square, 6 degrees of freedom, 99.9 %: a closure that the estimate is further from is not obeyed
APART = 11.34  # chi-square, 3 degrees of freedom, 99 %: two centres of one thing are nearer than this
LEAST_SHARE = 0.25  # of a landmark's measurements, that its first cluster has; fewer are outliers
LEAST_KEYFRAMES = 3  # that measured it, for a cluster to be a thing: `lifecycle.MERGED_FROM`
MIN_VISIBILITY = 0.1  # as of `depth_centre_factor`


@dataclass(frozen=True, slots=True)
class MixUp:
    """A landmark that is several things.

    Attributes:
        landmark: its number.
        keyframes: of each thing, those that measured it; first the thing that keeps the number.
    """

    landmark: int
    keyframes: tuple[frozenset[int], ...]

    def seen_in(self, keyframes: Iterable[int], part: int) -> set[int]:
        """Of keyframes that showed the landmark, those that showed this part: as the nearest that measured it did."""
        measured = np.array(sorted(k for part in self.keyframes for k in part))
        nearest = {k: int(measured[np.argmin(np.abs(measured - k))]) for k in keyframes}
        return {k for k, one in nearest.items() if one in self.keyframes[part]}


def disobeys(loop: Loop, poses: np.ndarray) -> bool:
    """Whether (M, 4, 4) poses are far from what a closure says, by its own covariance."""
    return chi_square(loop.T_a_b, inverse(poses[loop.a]) @ poses[loop.b], loop.covariance) > OBEYED


def find_mix_ups(
    landmarks: Iterable[Landmark], smoother: Smoother, poses: np.ndarray, config: LifecycleConfig
) -> list[MixUp]:
    """Landmarks whose measurements lie at several places, seen from (M, 4, 4) poses."""
    found = []
    for landmark in landmarks:
        records = [smoother.ledger[number] for number in smoother.measurements(landmark.number)]
        centres = [record for record in records if isinstance(record, DepthCentre)]
        if len({record.keyframe for record in centres}) < LEAST_KEYFRAMES:
            continue
        extent = config.merge_extent * float(np.mean(landmark.half_axes))
        parts = _clusters(centres, poses, extent)
        if len(parts) > 1:
            first, *others = _oldest_first(parts)
            others = [other for other in others if _are_apart(first, other, smoother, poses)]
            if others:
                found.append(MixUp(landmark.number, tuple(_keyframes(part) for part in (first, *others))))
    return found


def _clusters(centres: list[DepthCentre], poses: np.ndarray, extent: float) -> list[list[DepthCentre]]:
    """Measurements by place: connected by pairs that agree within their noise and an `extent` in metres."""
    positions, covariances = in_world(centres, poses)
    apart = positions[:, None] - positions[None]
    together = covariances[:, None] + covariances[None] + extent**2 * np.eye(3)
    agree = np.einsum("nmi,nmi->nm", apart, np.linalg.solve(together, apart[..., None])[..., 0]) < APART
    keyframes = np.array([record.keyframe for record in centres])
    agree |= keyframes[:, None] == keyframes[None]  # templates of one thing in one image
    count, label = connected_components(agree, directed=False)
    return [[centres[i] for i in np.flatnonzero(label == part)] for part in range(count)]


def in_world(centres: Sequence[DepthCentre], poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) places and (N, 3, 3) covariances of depth centres, world, metres."""
    T = poses[[record.keyframe for record in centres]]
    own = np.array([record.centre for record in centres])
    across, along = (np.array([getattr(r, f"sigma_{name}") for r in centres]) ** 2 for name in ("tangential", "range"))
    share = np.maximum([record.visibility for record in centres], MIN_VISIBILITY)
    ray = np.einsum("nij,nj->ni", T[:, :3, :3], own / np.linalg.norm(own, axis=1)[:, None])
    covariances = across[:, None, None] * np.eye(3) + (along - across)[:, None, None] * ray[:, :, None] * ray[:, None]
    return np.einsum("nij,nj->ni", T[:, :3, :3], own) + T[:, :3, 3], covariances / share[:, None, None]


def _oldest_first(parts: list[list[DepthCentre]]) -> list[list[DepthCentre]]:
    """What a landmark was first is what it is, unless that is a few outliers; the largest cluster otherwise."""
    total = sum(len(part) for part in parts)
    solid = [p for p in parts if len(_keyframes(p)) >= LEAST_KEYFRAMES and len(p) >= LEAST_SHARE * total]
    first = min(solid, key=lambda part: min(_keyframes(part))) if solid else max(parts, key=len)
    return [first, *(part for part in parts if part is not first)]


def _are_apart(a: list[DepthCentre], b: list[DepthCentre], smoother: Smoother, poses: np.ndarray) -> bool:
    """Whether drift of the camera between them cannot explain how far two clusters are apart."""
    (places_a, _), (places_b, _) = in_world(a, poses), in_world(b, poses)
    offset = np.median(places_a, axis=0) - np.median(places_b, axis=0)
    paths = smoother.path_covariances(b[0].keyframe)[[record.keyframe for record in a]]
    variances = np.diagonal(paths, axis1=1, axis2=2)
    lever = np.linalg.norm(b[0].centre)
    drift = float(np.min(variances[:, 3:].max(axis=1) + lever**2 * variances[:, :3].max(axis=1)))
    return bool(offset @ offset > APART * drift)


def _keyframes(part: list[DepthCentre]) -> frozenset[int]:
    return frozenset(record.keyframe for record in part)
