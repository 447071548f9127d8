"""Landmarks: things in the graph, with what is known of them outside it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .beliefs import Belief
from .embeddings import EmbeddingMean
from .size_site import SizeSite
from .view_log import ViewLog


@dataclass(slots=True, eq=False)
class Landmark:
    """A thing in the graph and the last known marginals of its variables.

    Attributes:
        number: its key in the graph, stable for ever.
        belief: class and existence.
        position, covariance: (3,), (3, 3) world, metres.
        log_size, log_size_covariance: (3,), (3, 3) log half-axes in the upright frame.
        first_seen, last_seen: stamps, seconds.
        supporting, occluded, contradicting: keyframes that spoke for it, could not see it, spoke against it.
        unsettled: whether its size site was still changing at the last full refresh.
        refreshed_at: number of measurements at the last full refresh of its belief.
        measurements: number of measurements in the graph.
        size_site: what stands for its class in `log_size_covariance`.
        log: what every view said.
        embedding: what it looks like.
    """

    number: int
    belief: Belief
    position: np.ndarray
    log_size: np.ndarray
    first_seen: float
    last_seen: float
    covariance: np.ndarray = field(default_factory=lambda: 0.01 * np.eye(3))
    log_size_covariance: np.ndarray = field(default_factory=lambda: np.eye(3))
    supporting: set[int] = field(default_factory=set)
    occluded: set[int] = field(default_factory=set)
    contradicting: set[int] = field(default_factory=set)
    measurements: int = 0
    refreshed_at: int = 0
    unsettled: bool = False
    size_site: SizeSite = field(default_factory=lambda: SizeSite(np.zeros(3), 1e-3 * np.eye(3)))
    log: ViewLog = field(default_factory=ViewLog)
    embedding: EmbeddingMean = field(default_factory=EmbeddingMean)

    @property
    def half_axes(self) -> np.ndarray:
        """(3,) metres, upright frame."""
        return np.exp(self.log_size)

    def count_from(self, other: Landmark) -> None:
        """Takes over the counts of a landmark merged into this one."""
        self.belief.absorb(other.belief)
        self.log.absorb(other.log)
        self.embedding.absorb(other.embedding)
        self.first_seen, self.last_seen = min(self.first_seen, other.first_seen), max(self.last_seen, other.last_seen)
        self.supporting |= other.supporting
        self.contradicting = (self.contradicting | other.contradicting) - self.supporting
        self.occluded = (self.occluded | other.occluded) - self.supporting - self.contradicting
        self.measurements += other.measurements


def volume_overlaps(landmarks: list[Landmark], R_world_upright: np.ndarray) -> np.ndarray:
    """(N, N) intersection of every two upright boxes over the smaller one's volume."""
    centres = np.array([x.position for x in landmarks]).reshape(-1, 3) @ R_world_upright
    half = np.array([x.half_axes for x in landmarks]).reshape(-1, 3)
    offset = np.abs(centres[:, None] - centres[None])
    reach = np.minimum(half[:, None] + half[None] - offset, 2.0 * np.minimum(half[:, None], half[None]))
    volume = np.prod(2.0 * half, axis=1)
    return np.prod(np.maximum(reach, 0.0), axis=2) / np.minimum(volume[:, None], volume[None])
