"""Decides on tracks by what was learned of tracks, in the place of Bayes' rule and the rule of 60 %."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .assessment import Assessment, Fate
from .track_evidence import TrackEvidence, track_features
from .track_judge import TrackJudge

MOST_SHARED = 0.5  # of the smaller box's volume, by two things; two that share more are one


def judged(
    assessment: Assessment, tracks: Sequence[TrackEvidence], judge: TrackJudge, percentiles: tuple[float, float]
) -> Assessment:
    """The same T tracks with the judge's distributions and fates: none is dropped for being seen seldom.

    Args:
        assessment: by the paper's rules; seen and sight are taken from it.
        tracks: the same T.
        judge: of the same classes.
        percentiles: of a track's points along an axis, between which it extends.
    """
    if not tracks:
        return assessment
    posterior = judge.distribution(track_features(tracks, len(judge.classes), percentiles))
    nothing = posterior.argmax(axis=1) == posterior.shape[1] - 1
    again = repeats(tracks, posterior[:, :-1].max(axis=1), percentiles)
    fates = [
        Fate.REPEATED if second else Fate.BACKGROUND if none else Fate.KEPT
        for second, none in zip(again, nothing, strict=True)
    ]
    return replace(assessment, posterior=posterior, per_view=posterior, fates=tuple(fates))


def repeats(tracks: Sequence[TrackEvidence], score: np.ndarray, percentiles: tuple[float, float]) -> np.ndarray:
    """(T,) bool: whether a surer track that stays is in the same place; pieces of a thing are tracks beside its own.

    Args:
        tracks: T of them.
        score: (T,) how sure each is; of equals the earlier stays.
        percentiles: as for `judged`.
    """
    ends = np.array([track.extents(percentiles) for track in tracks]).reshape(-1, 2, 3)
    low, high = ends[:, 0], ends[:, 1]
    volume = np.prod(high - low, axis=1)
    again, settled = np.zeros(len(tracks), dtype=np.bool_), np.zeros(len(tracks), dtype=np.bool_)
    for t in np.argsort(-score, kind="stable"):
        settled[t] = True
        if again[t]:
            continue
        shared = np.prod(np.clip(np.minimum(high, high[t]) - np.maximum(low, low[t]), 0.0, None), axis=1)
        again |= ~settled & (shared > MOST_SHARED * np.minimum(volume, volume[t]))
    return again
