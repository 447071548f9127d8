"""From the landmarks of a map to the keyframes between which their constellation may close a loop."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...config import ConstellationConfig
from ...estimation.landmarks import Landmark
from ...estimation.smoother import Smoother
from .candidates import LoopCandidate, constellation_of, loop_candidates, recent_and_old, seen_again
from .fit import Drift
from .matching import match_constellations


def same_places(
    landmarks: Iterable[Landmark], keyframe: int, smoother: Smoother, config: ConstellationConfig
) -> list[LoopCandidate]:
    """Pairs of keyframes that saw the same things, by what is known as one, and by what lies as if it were.

    The latter where what was mapped lately lies as something mapped long ago.

    Args:
        landmarks: of the map.
        keyframe: the latest.
        smoother: whose poses tell how far the camera may have drifted since.
        config: when things count as lately and as long ago mapped, and what is believed.
    """
    landmarks = list(landmarks)
    again = seen_again(landmarks, keyframe, smoother.poses(), config)
    return again + _that_lie_alike(landmarks, keyframe, smoother, config)


def _that_lie_alike(
    landmarks: list[Landmark], keyframe: int, smoother: Smoother, config: ConstellationConfig
) -> list[LoopCandidate]:
    recent, old = recent_and_old(landmarks, keyframe, config)
    if min(len(recent), len(old)) < config.min_matches:
        return []
    up = smoother.up()[0]
    matches = match_constellations(
        constellation_of(recent), constellation_of(old), up, config, drift=_drift(recent, old, smoother, up)
    )
    if not matches or matches[0].log_odds < config.min_log_odds:
        return []
    supporting = [x.supporting for x in recent], [x.supporting for x in old]
    return loop_candidates(matches[0], *supporting, smoother.poses(), config)


def _drift(recent: list[Landmark], old: list[Landmark], smoother: Smoother, up: np.ndarray) -> Drift:
    """How far the place of the recent things may be off against that of the old ones."""
    now = max(max(x.supporting) for x in recent)
    then = max(max(x.supporting) for x in old)
    covariance = smoother.path_covariances(now)[then]
    about_up = smoother.pose(now)[:3, :3].T @ up
    yaw = float(np.sqrt(about_up @ covariance[:3, :3] @ about_up))
    return Drift(yaw, float(np.sqrt(covariance[3:, 3:].trace() / 3.0)))
