"""Candidates: followed by a Kalman filter until they earn a landmark."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from filterpy.kalman import KalmanFilter

from ..config import TrackConfig
from .beliefs import Belief
from .lifting import LiftedDetection
from .view_log import ViewLog

MIN_SHARE = 0.1  # what shows less than this still measures as much


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """How one keyframe showed an object.

    Attributes:
        keyframe: its number.
        T_world_camera: (4, 4) its pose as known at the time, or at the last correction of the poses since.
        detections: at most one a template, the one that weighs most first.
        visible: (5,) visible share of every part.
        weight: how new the view was, 0 to 1.
    """

    keyframe: int
    T_world_camera: np.ndarray
    detections: tuple[LiftedDetection, ...]
    visible: np.ndarray
    weight: float

    @property
    def place(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) world, metres, and (3, 3) covariance of the object, by the detection that weighs most."""
        best, R = self.detections[0], self.T_world_camera[:3, :3]
        return R @ best.centre + self.T_world_camera[:3, 3], R @ best.covariance() @ R.T

    @property
    def shares(self) -> np.ndarray:
        """(n,) share of one full measurement's information that each detection brings.

        Templates that fire together see the same pixels: their shares are those of Explicit Occlusion, equation (4),
        and of a half hidden object half the pixels vote.
        """
        visible = np.maximum(self.visible[[d.part for d in self.detections]], MIN_SHARE)
        return visible * visible / visible.sum()


class Track:
    """A candidate's position under a constant-position Kalman filter, and its measurements for a later landmark.

    Attributes:
        number: of the track.
        belief: class and existence so far.
        hits, misses: numbers of the keyframes in which it was detected, and should have been but was not.
        observations: the keyframes that detected it.
        log: what every view said.
    """

    def __init__(self, number: int, position: np.ndarray, covariance: np.ndarray, belief: Belief) -> None:
        self.number, self.belief = number, belief
        self.hits: set[int] = set()
        self.misses: set[int] = set()
        self.misses_in_a_row = 0
        self.first_seen = self.last_seen = 0.0
        self.observations: list[Observation] = []
        self.log = ViewLog()
        self._filter = KalmanFilter(dim_x=3, dim_z=3)
        self._filter.x, self._filter.P = position.copy(), covariance.copy()
        self._filter.F = self._filter.H = np.eye(3)

    def see(self, seen: Observation, position: np.ndarray, covariance: np.ndarray) -> None:
        """Another keyframe showed it, at (3,) world with (3, 3) covariance."""
        self.correct(position, covariance)
        self.observations.append(seen)

    def predict(self, config: TrackConfig, keyframes: int = 1) -> None:
        """Keyframes pass: odometry drift against the map widens the position."""
        self._filter.Q = np.eye(3) * keyframes * config.process_sigma**2
        self._filter.predict()

    def correct(self, position: np.ndarray, covariance: np.ndarray) -> None:
        """A detection at (3,) world with (3, 3) covariance."""
        self._filter.update(position, R=covariance)

    def follow(self, T_world_keyframe: np.ndarray, config: TrackConfig) -> None:
        """Poses were corrected, (M, 4, 4) of all keyframes: position and covariance are found anew.

        The filter goes through the observations again, each at its keyframe's pose, as if those had been known.
        """
        moved = (replace(seen, T_world_camera=T_world_keyframe[seen.keyframe]) for seen in self.observations)
        first, *later = self.observations = sorted(moved, key=lambda seen: seen.keyframe)
        self._filter.x, self._filter.P = first.place
        now = first.keyframe
        for seen in later:
            self.predict(config, seen.keyframe - now)
            self.correct(*seen.place)
            now = seen.keyframe
        self.predict(config, len(T_world_keyframe) - now)

    def absorb(self, other: Track, T_world_keyframe: np.ndarray, config: TrackConfig) -> None:
        """Takes over a candidate that turned out to be this one; (M, 4, 4) poses of all keyframes."""
        own = {seen.keyframe for seen in self.observations}
        # a keyframe that missed the one and showed the other was wrong about where it looked
        self.belief.forget(self.misses & other.hits)
        other.belief.forget(other.misses & self.hits)
        self.observations += [seen for seen in other.observations if seen.keyframe not in own]
        self.hits |= other.hits
        self.misses = (self.misses | other.misses) - self.hits
        self.misses_in_a_row = min(self.misses_in_a_row, other.misses_in_a_row)
        self.first_seen, self.last_seen = min(self.first_seen, other.first_seen), max(self.last_seen, other.last_seen)
        self.belief.absorb(other.belief)
        self.log.absorb(other.log)
        self.follow(T_world_keyframe, config)

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
        half_extents = [d.half_extents for seen in self.observations for d in seen.detections]
        width, _, height = np.median(np.log(half_extents), axis=0)
        return np.array([width, width, height])

    def is_ripe(self, config: TrackConfig) -> bool:
        """Whether it has earned a landmark."""
        if self.belief.is_object >= config.min_existence:
            return True
        hits, misses = len(self.hits), len(self.misses)
        return hits >= config.min_hits and hits >= config.min_hit_rate * (hits + misses)

    def is_lost(self, config: TrackConfig) -> bool:
        """Whether it was missed too often where it should have been seen."""
        return self.misses_in_a_row >= config.max_misses
