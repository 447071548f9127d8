"""Tracks: observations of one thing from several keyframes, and what they say together of its class."""

from __future__ import annotations

import numpy as np

from .class_distribution import bayes_update
from .linking import NEW, link
from .observations import Observations


class Tracks:
    """Grows keyframe by keyframe; a track once started stays, and its number is its place in every array.

    A centroid is kept in the axes of the camera that saw it, so that a track moves when keyframes do.
    """

    def __init__(self) -> None:
        self.log_posterior = np.empty((0, 0))  # (T, K + 1) log p(C | y^1..n), the background last
        self.log_posterior.flags.writeable = False
        self._centroids: list[np.ndarray] = []  # (N, 3) of every keyframe's observations, camera frame
        self._keyframes: list[np.ndarray] = []  # (N,)
        self._numbers: list[np.ndarray] = []  # (N,)

    def __len__(self) -> int:
        return len(self.log_posterior)

    def add(
        self, observations: Observations, keyframe: int, T_world_keyframe: np.ndarray, max_distance: float
    ) -> np.ndarray:
        """Links a keyframe's observations to tracks, starts new ones for the rest, and updates their classes.

        Args:
            observations: N of the latest keyframe.
            keyframe: its number.
            T_world_keyframe: (M, 4, 4) poses of all keyframes as estimated now.
            max_distance: metres, as for `link`.

        Returns:
            (N,) numbers of the tracks.
        """
        T = T_world_keyframe[keyframe]
        numbers = link(observations.centroid @ T[:3, :3].T + T[:3, 3], self.centroids(T_world_keyframe), max_distance)
        new = numbers == NEW
        numbers[new] = len(self) + np.arange(new.sum())
        self._update(numbers, int(new.sum()), observations.log_distribution)
        self._centroids.append(observations.centroid)
        self._keyframes.append(np.full(len(numbers), keyframe))
        self._numbers.append(numbers)
        return numbers

    def centroids(self, T_world_keyframe: np.ndarray) -> np.ndarray:
        """(T, 3) means of the tracks' observations, world, metres, under (M, 4, 4) keyframe poses."""
        places, numbers = self.places(T_world_keyframe)
        count = np.maximum(np.bincount(numbers, minlength=len(self)), 1)
        sums = [np.bincount(numbers, weights=places[:, axis], minlength=len(self)) for axis in range(3)]
        return np.stack(sums, axis=1) / count[:, None]

    def places(self, T_world_keyframe: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) centroids of all observations, world, metres, and (N,) the numbers of their tracks."""
        if not self._centroids:
            return np.empty((0, 3)), np.empty(0, dtype=np.int64)
        T = T_world_keyframe[np.concatenate(self._keyframes)]
        centroids = np.concatenate(self._centroids)
        return np.einsum("nij,nj->ni", T[:, :3, :3], centroids) + T[:, :3, 3], np.concatenate(self._numbers)

    def _update(self, numbers: np.ndarray, new: int, log_distribution: np.ndarray) -> None:
        """Equation (2) for the tracks (N,) that were seen; the new ones start uniform."""
        classes = log_distribution.shape[1]
        start = np.full((new, classes), -np.log(classes))
        log_posterior = np.concatenate([self.log_posterior.reshape(-1, classes), start])
        log_posterior[numbers] = bayes_update(log_posterior[numbers], log_distribution)
        log_posterior.flags.writeable = False
        self.log_posterior = log_posterior
