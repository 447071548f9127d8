"""Candidates: followed by a Kalman filter until they earn a landmark."""

from __future__ import annotations

import numpy as np
from filterpy.kalman import KalmanFilter

from ..config import TrackConfig
from .beliefs import Belief
from .lifting import LiftedDetection


class Track:
    """A candidate's position under a constant-position Kalman filter, and its measurements for a later landmark.

    Attributes:
        number: of the track.
        belief: class and existence so far.
        hits, misses: numbers of the keyframes in which it was detected, and should have been but was not.
        observations: (keyframe, detection, visible share, view weight) of every hit.
    """

    def __init__(self, number: int, position: np.ndarray, covariance: np.ndarray, belief: Belief) -> None:
        self.number, self.belief = number, belief
        self.hits: set[int] = set()
        self.misses: set[int] = set()
        self.misses_in_a_row = 0
        self.first_seen = self.last_seen = 0.0
        self.observations: list[tuple[int, LiftedDetection, float, float]] = []
        self._filter = KalmanFilter(dim_x=3, dim_z=3)
        self._filter.x, self._filter.P = position.copy(), covariance.copy()
        self._filter.F = self._filter.H = np.eye(3)

    def predict(self, config: TrackConfig) -> None:
        """One keyframe passes: odometry drift against the map widens the position."""
        self._filter.Q = np.eye(3) * config.process_sigma**2
        self._filter.predict()

    def correct(self, position: np.ndarray, covariance: np.ndarray) -> None:
        """A detection at (3,) world with (3, 3) covariance."""
        self._filter.update(position, R=covariance)

    @property
    def position(self) -> np.ndarray:
        """(3,) world, metres."""
        return self._filter.x.copy()

    @property
    def covariance(self) -> np.ndarray:
        """(3, 3) square metres."""
        return self._filter.P.copy()

    @property
    def log_size(self) -> np.ndarray:
        """(3,) log half-axes in the upright frame: the median of the boxes; both horizontal axes alike."""
        width, _, height = np.median(np.log([d.half_extents for _, d, _, _ in self.observations]), axis=0)
        return np.array([width, width, height])

    def is_ripe(self, config: TrackConfig) -> bool:
        """Whether it has earned a landmark."""
        hits, misses = len(self.hits), len(self.misses)
        return hits >= config.min_hits and hits >= config.min_hit_rate * (hits + misses)

    def is_lost(self, config: TrackConfig) -> bool:
        """Whether it was missed too often where it should have been seen."""
        return self.misses_in_a_row >= config.max_misses
