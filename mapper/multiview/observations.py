"""What a keyframe's detections show of things in space, whatever a box would make of them.

A detection's mask says which depth readings are the object's. Without one, the readings of the box's central part stand
for it: what is behind shows through a handle, and of an object that is half hidden they are the other's. Masks are
better, and proposals have them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...datasets.frame import Frame
from ...detectors.detections import Detections, Part
from ..config import LiftingConfig, MultiViewConfig
from ..estimation.outcomes import Outcome
from .class_distribution import class_distribution


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """N detections of one keyframe that have a place.

    Attributes:
        row: (N,) of the keyframe's detections.
        centroid: (N, 3) mean of the readings, camera frame, metres.
        points: of each, (P, 3) float32 some of its readings, camera frame, metres; without a mask spread over the box.
        log_distribution: (N, K + 1) log p(y), the background last.
        class_id, confidence: (N,) best class and its score, as the detector gave it.
        embedding: (N, D) float32 as the detector gave it, or None.
    """

    row: np.ndarray
    centroid: np.ndarray
    points: tuple[np.ndarray, ...]
    log_distribution: np.ndarray
    class_id: np.ndarray
    confidence: np.ndarray
    embedding: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.row)


def observe(
    detections: Detections, frame: Frame, lifting: LiftingConfig, config: MultiViewConfig
) -> tuple[Observations, Counter[Outcome]]:
    """The detections of whole things that have enough readings, and why the others are left out.

    Scores do not matter here: what is most likely background is an observation too, and says so to its track.
    """
    kept: list[tuple[int, np.ndarray, np.ndarray]] = []  # row, centroid, points
    refused: Counter[Outcome] = Counter()
    for row in range(len(detections)):
        if detections.part[row] != Part.WHOLE:
            refused[Outcome.PART_UNUSED] += 1
            continue
        uv, z, stretch = _readings(detections, row, frame, lifting.central_share)
        near = z < config.far
        if near.sum() < lifting.min_readings:
            refused[Outcome.NO_DEPTH if len(z) < lifting.min_readings else Outcome.OUT_OF_RANGE] += 1
            continue
        centroid = frame.intrinsics.back_project(uv[near], z[near]).mean(axis=0)
        some = np.unique(np.linspace(0, near.sum() - 1, config.points).astype(np.int64))
        points = frame.intrinsics.back_project(stretch(uv[near][some]), z[near][some])
        kept.append((row, centroid, points.astype(np.float32)))
    chosen = np.array([row for row, _, _ in kept], dtype=np.int64)
    observations = Observations(
        row=chosen,
        centroid=np.array([centroid for _, centroid, _ in kept]).reshape(-1, 3),
        points=tuple(points for _, _, points in kept),
        log_distribution=np.log(class_distribution(detections.scores[chosen], config.least_probability)),
        class_id=detections.class_id[chosen],
        confidence=detections.confidence[chosen],
        embedding=None if detections.embedding is None else detections.embedding[chosen],
    )
    return observations, refused


def _readings(
    detections: Detections, row: int, frame: Frame, central_share: float
) -> tuple[np.ndarray, np.ndarray, Callable[[np.ndarray], np.ndarray]]:
    """(P, 2) pixels and (P,) depths, metres, of one detection, and where these pixels are on the whole object.

    The central part of a box is stretched over it: the depth of its middle stands for all of it.
    """
    depth = frame.depth
    if detections.mask is not None:
        v, u = np.divmod(np.flatnonzero(detections.mask[row] & (depth > 0.0)), depth.shape[1])
        return np.stack([u, v], axis=1), depth[v, u].astype(np.float64), lambda uv: uv
    low, high = detections.xyxy[row, :2] - 0.5, detections.xyxy[row, 2:] - 0.5  # pixel centres at integers
    middle, half = (low + high) / 2.0, (high - low) * central_share / 2.0
    x0, y0 = np.maximum(np.floor(middle - half).astype(int), 0)
    x1, y1 = np.maximum(np.ceil(middle + half).astype(int) + 1, 0)
    v, u = np.nonzero(depth[y0:y1, x0:x1] > 0.0)
    z = depth[y0:y1, x0:x1][v, u].astype(np.float64)
    return np.stack([u + x0, v + y0], axis=1), z, lambda uv: middle + (uv - middle) / central_share
