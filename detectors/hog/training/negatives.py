"""The negatives of one template: windows of frames, known by their places and kept with their features."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..pyramid import Pyramid


@dataclass(frozen=True, slots=True, eq=False)
class Negatives:
    """N windows.

    Attributes:
        place: (N, 4) int32 frame, level, row and column of the window's first cell, border included.
        samples: (N, D) float16, see `sample_rows`.
    """

    place: np.ndarray
    samples: np.ndarray

    def __len__(self) -> int:
        return len(self.place)

    @classmethod
    def none(cls, width: int) -> Negatives:
        """No windows yet, of D = `width`."""
        return cls(np.zeros((0, 4), np.int32), np.zeros((0, width), np.float16))

    def select(self, index: np.ndarray) -> Negatives:
        """Those that a mask or indices name, in that order."""
        return Negatives(self.place[index], self.samples[index])

    def with_more(self, others: Negatives) -> Negatives:
        """These, then the others."""
        return Negatives(np.concatenate([self.place, others.place]), np.concatenate([self.samples, others.samples]))

    def hardest(self, score: np.ndarray, most: int) -> Negatives:
        """The `most` with the highest scores (N,), in the order that they have here; of equal ones the first."""
        if len(self) <= most:
            return self
        return self.select(np.sort(np.argsort(-score, kind="stable")[:most]))


def sample_rows(windows: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """What an SVM learns from: (N, rows, columns, C) features and (N,) scales to (N, rows * columns * C + 1) float16.

    Half precision keeps three digits, more than eight bits of colour hold, and twice as many negatives.
    """
    flat = windows.reshape(len(windows), int(np.prod(windows.shape[1:])))
    return np.concatenate([flat, np.log2(scale)[:, None]], axis=1).astype(np.float16)


def window_samples(pyramid: Pyramid, place: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """`sample_rows` of N > 0 windows of a pyramid, at (N, 3) level, row and column."""
    windows = np.stack([pyramid.levels[k].features[i : i + rows, j : j + columns] for k, i, j in place])
    return sample_rows(windows, np.array([pyramid.levels[k].scale for k in place[:, 0]]))


def key(place: np.ndarray) -> np.ndarray:
    """(N,) int64, one number for each place (N, 4)."""
    frame, level, row, column = place.astype(np.int64).T
    return ((frame << 8 | level) << 16 | row) << 16 | column
