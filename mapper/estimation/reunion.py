"""Which members of the scene are one thing: how far two of them disagree, and candidates that join what they are of.

Where the camera's pose was wrong for a while, what it saw then is in the map a second time. Once a loop closure has
corrected the poses, both lie at the same place. Landmarks merge as they always do (`Lifecycle.merge`); a candidate
joins the landmark, or else the older candidate, that it agrees with in place, size and class. What had been retired
only because wrong poses looked for it where it is not counts again, as part of what they saw instead.
"""

from __future__ import annotations

import numpy as np

from ..config import LifecycleConfig, TrackConfig
from .beliefs import Belief
from .evidence import Observer
from .landmarks import Landmark, volume_overlaps
from .scene import Scene
from .smoother import Smoother
from .tracks import Track

CANDIDATE_SIZE_SIGMA = 0.25  # log units; a few boxes tell a candidate's half-axes this well
CONTRADICTION = 0.05  # odds of "of one class" against chance, below which classes contradict each other: 20 to 1


def distance(a: Landmark, b: Landmark, covariance: np.ndarray, config: LifecycleConfig) -> float:
    """Squared Mahalanobis distance of position and log size, chi-square of 6 degrees of freedom for one thing.

    Args:
        a, b: whose positions and sizes are compared.
        covariance: (3, 3) of position a - position b, square metres.
        config: how far the measured volumes of one thing differ.
    """
    # a book in the middle of a table is at the same place, but not of the same size
    unlike, apart = a.log_size - b.log_size, a.position - b.position
    size_covariance = a.log_size_covariance + b.log_size_covariance + config.merge_log_size**2 * np.eye(3)
    # a partly seen object's centre is off by a share of its extent
    extent = config.merge_extent * min(float(np.mean(a.half_axes)), float(np.mean(b.half_axes)))
    size = float(unlike @ np.linalg.solve(size_covariance, unlike))
    return size + float(apart @ np.linalg.solve(covariance + extent**2 * np.eye(3), apart))


def contradict(a: Belief, b: Belief) -> bool:
    """Whether two things are almost surely of different classes: K Σ_k a_k b_k < `CONTRADICTION`."""
    p, q = a.class_posterior(), b.class_posterior()
    return len(p) * float(p @ q) < CONTRADICTION


def take_over(kept: Landmark, other: Landmark) -> None:
    """`other` turned out to be `kept`: its counts and evidence are added.

    A keyframe that missed the one and showed the other was wrong about where it looked: what it missed is taken back.
    """
    kept.belief.forget(kept.contradicting & other.supporting)
    other.belief.forget(other.contradicting & kept.supporting)
    kept.count_from(other)
    kept.belief.update()


def recall_retired(scene: Scene, smoother: Smoother, config: LifecycleConfig) -> int:
    """Retired landmarks that were never gone become part of the landmark that they are; returns how many did.

    That is so where the very keyframes that spoke against the one showed the other, which nobody had seen before.
    Something else that was put in the same place afterwards is no such case, nor is what was retired beside a thing.
    The older of both keeps its number.
    """
    recalled = 0
    for retired in list(scene.retired.values()):
        last = max(retired.supporting, default=-1)
        landmarks = [x for x in scene.landmarks.values() if x.supporting & retired.contradicting]
        landmarks = [x for x in landmarks if min(x.supporting) > last]
        nearest = _nearest(retired, landmarks, smoother.R_world_upright, config)
        if nearest is None:
            continue
        landmark = landmarks[nearest]
        smoother.revive(retired.number, retired.position, retired.log_size, retired.size_site)
        scene.landmarks[retired.number] = scene.retired.pop(retired.number)
        kept, other = sorted((retired, landmark), key=lambda x: x.number)
        smoother.merge(kept.number, other.number)
        take_over(kept, other)
        del scene.landmarks[other.number]
        recalled += 1
    return recalled


def unite_candidates(
    scene: Scene, smoother: Smoother, observer: Observer, tracks: TrackConfig, config: LifecycleConfig
) -> int:
    """Candidates that are a landmark, or an older candidate, become part of it; returns how many did.

    Their observations become the landmark's measurements, what was said of them is said of it.
    """
    poses, kept = smoother.poses(), []
    for track in sorted(scene.tracks, key=lambda track: track.number):
        own = _as_landmark(track)
        landmarks = [x for x in scene.landmarks.values() if not x.supporting & track.hits]
        nearest = _nearest(own, landmarks, smoother.R_world_upright, config)
        if nearest is not None:
            _join(landmarks[nearest], track, own, observer)
            continue
        older = [x for x in kept if not x.hits & track.hits]
        nearest = _nearest(own, [_as_landmark(x) for x in older], smoother.R_world_upright, config)
        if nearest is not None:
            older[nearest].absorb(track, poses, tracks)
            continue
        kept.append(track)
    united, scene.tracks = len(scene.tracks) - len(kept), kept
    return united


def _nearest(own: Landmark, others: list[Landmark], R_world_upright: np.ndarray, config: LifecycleConfig) -> int | None:
    """Which of the others something agrees with best, None where it agrees with none.

    Those that were detected beside it in one image are to be left out beforehand: they are two.
    """
    if not others:
        return None
    overlaps = volume_overlaps([own, *others], R_world_upright)[0, 1:]
    distances = np.array([distance(own, other, own.covariance + other.covariance, config) for other in others])
    fits = (overlaps > config.merge_overlap) & (distances < config.merge_gate)
    fits &= [not contradict(own.belief, other.belief) for other in others]
    return int(np.argmin(np.where(fits, distances, np.inf))) if fits.any() else None


def _join(landmark: Landmark, track: Track, own: Landmark, observer: Observer) -> None:
    for seen in track.observations:
        observer.record_scores(landmark.number, seen)
        observer.measure(landmark, seen)
    take_over(landmark, own)


def _as_landmark(track: Track) -> Landmark:
    """The candidate as the landmark that it would be, without measurements."""
    return Landmark(
        number=-1,
        belief=track.belief,
        position=track.position,
        log_size=track.log_size,
        first_seen=track.first_seen,
        last_seen=track.last_seen,
        covariance=track.covariance,
        log_size_covariance=CANDIDATE_SIZE_SIGMA**2 * np.eye(3),
        supporting=track.hits,
        contradicting=track.misses,
        log=track.log,
    )
