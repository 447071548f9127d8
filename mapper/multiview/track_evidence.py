"""What all views together show of a track, as numbers: what each said of its class, and the shape of all points.

Single views take a candle for a mug again and again, and Bayes' rule makes a certainty of it. But they do not take it
for a mug in quite the way in which they take mugs: some views doubt, other classes are named beside it, and the points
of all views together have another profile than a mug's. From these features `TrackJudge` learns to tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import softmax

from .kept_views import NOBODY, KeptView

LEAST_LENGTH = 0.005  # m, added to lengths before their logs: below it depth cameras tell nothing
QUARTILES = (25.0, 75.0)  # percentiles over views of a class's probability
RADII = (20.0, 50.0, 90.0)  # percentiles of the distance from the upright axis, for every slice of the height
SLICES = 5  # of the height
MOST_VIEWS = 10  # beyond which another view tells no more of whether a track is there at all
SURROUND = 0.01  # m beyond the extents within which points still count


@dataclass(frozen=True, slots=True, eq=False)
class TrackEvidence:
    """One track over the N views that saw it.

    Attributes:
        log_distribution: (N, K + 1) log p(y) of each, the background last.
        points: of each, (P, 3) metres, axes of the upright frame, z up.
        share: of the views that could show the track those that did.
    """

    log_distribution: np.ndarray
    points: tuple[np.ndarray, ...]
    share: float

    def cloud(self) -> np.ndarray:
        """(P, 3) points of all views."""
        return np.concatenate(self.points)

    def extents(self, percentiles: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """(3,) lower and (3,) upper ends of the cloud along the upright axes, metres."""
        low, high = np.percentile(self.cloud(), percentiles, axis=0)
        return low, high


def gather(
    views: Sequence[KeptView], T_world_keyframe: np.ndarray, R_world_upright: np.ndarray, shares: np.ndarray
) -> tuple[TrackEvidence, ...]:
    """The evidence of T tracks, by number.

    Args:
        views: all that were kept.
        T_world_keyframe: (M, 4, 4) poses of all keyframes.
        R_world_upright: (3, 3) axes of the upright frame.
        shares: (T,) `Assessment.shares`.
    """
    said: list[list[np.ndarray]] = [[] for _ in shares]
    points: list[list[np.ndarray]] = [[] for _ in shares]
    for view in views:
        T, seen = T_world_keyframe[view.keyframe], view.observations
        for i, track in enumerate(view.track[seen.row].tolist()):
            if track != NOBODY:
                said[track].append(seen.log_distribution[i])
                points[track].append((seen.points[i] @ T[:3, :3].T + T[:3, 3]) @ R_world_upright)
    return tuple(
        TrackEvidence(np.array(one), tuple(cloud), float(share))
        for one, cloud, share in zip(said, points, shares, strict=True)
    )


def feature_count(classes: int) -> int:
    """How many features a track has for K classes."""
    return (len(QUARTILES) + 3) * classes + 1 + 3 + 3 + SLICES * (len(RADII) + 1) + 4


def track_features(tracks: Sequence[TrackEvidence], classes: int, percentiles: tuple[float, float]) -> np.ndarray:
    """(T, F) features of tracks for K classes; see the functions below for the columns, in their order.

    Args:
        tracks: T of them.
        classes: K.
        percentiles: of a track's points along an axis, between which it extends.
    """
    rows = [
        np.concatenate([_said(track), _lengths(track, percentiles), _profile(track, percentiles), _sight(track)])
        for track in tracks
    ]
    return np.array(rows).reshape(-1, feature_count(classes))


def _said(track: TrackEvidence) -> np.ndarray:
    """Of every class: mean log p(class) / p(background), log of the mean p (background too), most p, quartiles of p."""
    log_p = track.log_distribution
    p = softmax(log_p, axis=1)
    quartiles = np.percentile(p[:, :-1], QUARTILES, axis=0).ravel()
    ratio = (log_p[:, :-1] - log_p[:, -1:]).mean(axis=0)
    return np.concatenate([ratio, np.log(p.mean(axis=0)), log_p[:, :-1].max(axis=0), quartiles])


def _lengths(track: TrackEvidence, percentiles: tuple[float, float]) -> np.ndarray:
    """Logs of the cloud's height, larger and smaller width; and the same of what the typical view sees of it."""
    low, high = track.extents(percentiles)
    each = [np.ptp(np.percentile(points, percentiles, axis=0), axis=0) for points in track.points]
    both = np.array([high - low, np.median(each, axis=0)])
    widths = np.sort(both[:, :2], axis=1)
    return np.log(np.column_stack([both[:, 2], widths[:, 1], widths[:, 0]]) + LEAST_LENGTH).ravel()


def _profile(track: TrackEvidence, percentiles: tuple[float, float]) -> np.ndarray:
    """Of slices from the lowest: logs of `RADII` about the upright axis through the middle; then shares of points."""
    cloud, (low, high) = track.cloud(), track.extents(percentiles)
    cloud = cloud[np.all((cloud >= low - SURROUND) & (cloud <= high + SURROUND), axis=1)]
    radius = np.linalg.norm(cloud[:, :2] - (low + high)[:2] / 2.0, axis=1)
    height = (cloud[:, 2] - low[2]) / max(high[2] - low[2], LEAST_LENGTH)
    slice_of = np.clip((height * SLICES).astype(np.int64), 0, SLICES - 1)
    radii = np.zeros((SLICES, len(RADII)))
    for k in np.unique(slice_of).tolist():
        radii[k] = np.percentile(radius[slice_of == k], RADII)
    shares = np.bincount(slice_of, minlength=SLICES) / max(len(cloud), 1)
    return np.concatenate([np.log(radii + LEAST_LENGTH).ravel(), shares])


def _sight(track: TrackEvidence) -> np.ndarray:
    """The share of views and its log, log of their number, and log of the metres by which their middles differ."""
    views = len(track.points)
    middles = np.array([points.mean(axis=0) for points in track.points])
    off = middles.std(axis=0).mean() if views > 1 else SURROUND
    return np.array([track.share, np.log(track.share), np.log(min(views, MOST_VIEWS)), np.log(off + LEAST_LENGTH)])
