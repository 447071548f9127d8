"""Tracks in an image: where their points, those of all views, would be seen.

A view that missed a thing has no proposal of it, and in another it came in pieces; the track knows where it is and how
large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...datasets.frame import Intrinsics
from .assessment import Assessment, Fate
from .sight import Sight
from .track_evidence import TrackEvidence

OUTLIERS = (1.5, 98.5)  # percentiles of the pixels' columns and rows between which a box extends
NEAREST = 0.05  # m along z
POINTS = 2000  # of a track that are drawn, at most


@dataclass(frozen=True, slots=True, eq=False)
class DrawnTracks:
    """N tracks in an image.

    Attributes:
        track: (N,) numbers.
        xyxy: (N, 4) pixels, as detectors' boxes: an image spans [0, W] x [0, H]. Not clipped to it.
        class_id: (N,) likeliest class that is not the background, be that likelier or not.
        score: (N,) probability of it, by which they are ranked.
    """

    track: np.ndarray
    xyxy: np.ndarray
    class_id: np.ndarray
    score: np.ndarray


def draw_tracks(
    assessment: Assessment,
    tracks: Sequence[TrackEvidence],
    column: int,
    T_upright_camera: np.ndarray,
    intrinsics: Intrinsics,
) -> DrawnTracks:
    """The tracks that a view shows or could show; those dropped, and those that repeat a surer one, are left out.

    Args:
        assessment: of T tracks over V views.
        tracks: the same T.
        column: which of the views.
        T_upright_camera: (4, 4) of that view, in the axes of the tracks' points.
        intrinsics: of its image.
    """
    shown = assessment.seen[:, column] | (assessment.sight[:, column] == Sight.VISIBLE)
    claimed = np.array([fate in (Fate.KEPT, Fate.BACKGROUND) for fate in assessment.fates], dtype=np.bool_)
    numbers = np.flatnonzero(shown & claimed)
    clouds = [tracks[t].cloud() for t in numbers.tolist()]
    boxes = np.array([image_box(cloud, T_upright_camera, intrinsics) for cloud in clouds]).reshape(-1, 4)
    whole = np.isfinite(boxes).all(axis=1)
    numbers, boxes = numbers[whole], boxes[whole]
    p = assessment.per_view[numbers, :-1]
    best = p.argmax(axis=1) if len(numbers) else np.empty(0, dtype=np.int64)
    return DrawnTracks(numbers, boxes, best, p[np.arange(len(numbers)), best])


def image_box(points: np.ndarray, T_world_camera: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """(4,) pixels, outer edges, of a cloud's image less a few outliers; NaN for one not wholly before the camera.

    Args:
        points: (P, 3) metres, P > 0.
        T_world_camera: (4, 4) in the points' axes.
        intrinsics: of the image.
    """
    some = points[np.unique(np.linspace(0, len(points) - 1, POINTS).astype(np.int64))]
    x, y, z = ((some - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]).T
    if np.mean(z > NEAREST) < OUTLIERS[1] / 100.0:
        return np.full(4, np.nan)
    x, y, z = x[z > NEAREST], y[z > NEAREST], z[z > NEAREST]
    k = intrinsics
    low, high = np.percentile(np.stack([k.fx * x / z + k.cx, k.fy * y / z + k.cy], axis=1), OUTLIERS, axis=0)
    return np.concatenate([low, high + 1.0])  # from pixel centres at integers to outer edges
