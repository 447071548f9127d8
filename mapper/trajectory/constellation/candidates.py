"""From landmarks to constellations, and from their match to keyframes between which a loop may be closed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

import numpy as np

from ...config import ConstellationConfig
from ...estimation.landmarks import Landmark
from .matching import Constellation, ConstellationMatch

VIEW_UNITS = (0.8, 0.52)  # m, rad (30 degrees): to about there a loop verified by features can be trusted
FARTHEST = 2.0  # of these units together, beyond which depth has hardly anything to match
SEEN_SHARE = 0.5  # of the most matched things that any two keyframes both saw: those with fewer are not proposed
NEIGHBOURS = 3  # keyframes around a proposed one that would only say the same


@dataclass(frozen=True, slots=True, eq=False)
class LoopCandidate:
    """Two keyframes that may have seen one place.

    Attributes:
        old, recent: their numbers.
        T_old_recent: (4, 4) guess of the recent camera in the old camera.
        seen: matched things that both saw.
    """

    old: int
    recent: int
    T_old_recent: np.ndarray
    seen: int


def recent_and_old(
    landmarks: Iterable[Landmark], keyframe_now: int, config: ConstellationConfig
) -> tuple[list[Landmark], list[Landmark]]:
    """Confident landmarks first seen in the last `recent_keyframes`, and those not seen in the last `old_keyframes`.

    Both in the order of their numbers; what was seen before and lately is in neither, it is one thing already.
    """
    recent, old = [], []
    for landmark in sorted(landmarks, key=lambda one: one.number):
        if not landmark.supporting or landmark.belief.existence < config.min_existence:
            continue
        if min(landmark.supporting) > keyframe_now - config.recent_keyframes:
            recent.append(landmark)
        elif max(landmark.supporting) <= keyframe_now - config.old_keyframes:
            old.append(landmark)
    return recent, old


def seen_again(
    landmarks: Iterable[Landmark], keyframe_now: int, T_world_camera: np.ndarray, config: ConstellationConfig
) -> list[LoopCandidate]:
    """Pairs of keyframes that saw the same landmarks, known for what they are: now, and before `old_keyframes`.

    After little drift a thing is recognised by where it lies. That ties the two times together, but as loosely as
    things are measured; depth can do it a hundred times better where it is told, by the poses as they are, where from.
    """
    lately: list[set[int]] = []
    before: list[set[int]] = []
    for landmark in sorted(landmarks, key=lambda one: one.number):
        if landmark.belief.existence < config.min_existence:
            continue
        now = {k for k in landmark.supporting if k > keyframe_now - config.again_keyframes}
        then = {k for k in landmark.supporting if k <= keyframe_now - config.old_keyframes}
        if now and then:
            lately.append(now)
            before.append(then)
    if len(lately) < config.min_matches:
        return []
    return nearest_views(np.eye(4), lately, before, T_world_camera, config)


def constellation_of(landmarks: Sequence[Landmark]) -> Constellation:
    """Landmarks as arrays, in their order.

    Their marginals hold the camera's drift from the start of the map, which neighbours share. Along a path
    Cov(a - b) = Cov a - Cov b for b seen first, so the best known covariance is taken away from all.
    """
    covariances = np.array([x.covariance for x in landmarks]).reshape(-1, 3, 3)
    if landmarks:
        shared = covariances[np.argmin(np.trace(covariances, axis1=1, axis2=2))]
        values, vectors = np.linalg.eigh(covariances - shared)
        covariances = (vectors * np.maximum(values, 0.0)[:, None]) @ np.swapaxes(vectors, 1, 2)
    return Constellation(
        np.array([x.number for x in landmarks], dtype=int),
        np.array([x.position for x in landmarks]).reshape(-1, 3),
        covariances,
        np.array([x.belief.class_posterior() for x in landmarks]) if landmarks else np.empty((0, 0)),
        np.array([x.log_size for x in landmarks]).reshape(-1, 3),
        np.array([x.belief.existence for x in landmarks]),
    )


def loop_candidates(
    match: ConstellationMatch,
    recent_supporting: Sequence[AbstractSet[int]],
    old_supporting: Sequence[AbstractSet[int]],
    T_world_camera: np.ndarray,
    config: ConstellationConfig,
) -> list[LoopCandidate]:
    """Pairs of keyframes that saw most of the matched things, those from nearly the same place first.

    Args:
        match: of the two constellations.
        recent_supporting, old_supporting: of each of their things, the keyframes that saw it.
        T_world_camera: (M, 4, 4) poses of all keyframes, by number, as they are before the correction.
        config: how many.
    """
    recent = [recent_supporting[i] for i, _ in match.pairs]
    return nearest_views(
        match.T_old_recent, recent, [old_supporting[j] for _, j in match.pairs], T_world_camera, config
    )


def nearest_views(
    T_old_recent: np.ndarray,
    recent_supporting: Sequence[AbstractSet[int]],
    old_supporting: Sequence[AbstractSet[int]],
    T_world_camera: np.ndarray,
    config: ConstellationConfig,
) -> list[LoopCandidate]:
    """`loop_candidates` of P matched things, given the keyframes that saw each lately, and those of long ago."""
    recent, saw_recent = _witnesses(recent_supporting)
    old, saw_old = _witnesses(old_supporting)
    if not len(recent) or not len(old):
        return []
    seen = saw_recent.T.astype(int) @ saw_old.astype(int)
    if seen.max() == 0:
        return []
    before, now = T_world_camera[old], T_old_recent @ T_world_camera[recent]
    moved = np.linalg.norm(now[:, None, :3, 3] - before[None, :, :3, 3], axis=2)
    cosine = 0.5 * (np.einsum("aij,bij->ab", now[:, :3, :3], before[:, :3, :3]) - 1.0)
    turned = np.arccos(np.clip(cosine, -1.0, 1.0))
    apart = np.hypot(moved / VIEW_UNITS[0], turned / VIEW_UNITS[1])
    apart[(seen < SEEN_SHARE * seen.max()) | (apart > FARTHEST)] = np.inf
    candidates: list[LoopCandidate] = []
    for index in np.argsort(apart, axis=None, kind="stable"):
        a, b = np.unravel_index(index, apart.shape)
        if len(candidates) == config.max_candidates or not np.isfinite(apart[a, b]):
            break
        new = all(abs(recent[a] - c.recent) > NEIGHBOURS or abs(old[b] - c.old) > NEIGHBOURS for c in candidates)
        if new:
            guess = np.linalg.inv(before[b]) @ now[a]
            candidates.append(LoopCandidate(int(old[b]), int(recent[a]), guess, int(seen[a, b])))
    return candidates


def _witnesses(supporting: Sequence[AbstractSet[int]]) -> tuple[np.ndarray, np.ndarray]:
    """(A,) keyframes that saw any of P things, ascending, and (P, A) bool, which saw which."""
    keyframes = np.array(sorted(set().union(*supporting)), dtype=int)
    saw = np.array([[int(keyframe) in one for keyframe in keyframes] for one in supporting], dtype=bool)
    return keyframes, saw.reshape(len(supporting), len(keyframes))
