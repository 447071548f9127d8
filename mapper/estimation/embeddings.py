"""What a landmark looks like: the mean of the detector's embeddings over its views."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

KEPT_BLOCKS = 16  # runs of views kept apart: 32 kB a landmark with embeddings of 512 numbers
SHORTEST = 1e-9  # length of an embedding, or of a mean of unit vectors, that has no direction


@dataclass(slots=True, eq=False)
class _Block:
    """Views that lie next to each other in time: their keyframes, and the weighted sum (D,) of their embeddings."""

    keyframes: set[int]
    sum: np.ndarray
    weight: float


@dataclass(slots=True, eq=False)
class EmbeddingMean:
    """Weighted mean of unit vectors, in bounded memory.

    Every embedding is brought to length 1 first, so that no view counts more because its vector is longer. What is kept
    are the sums of at most `KEPT_BLOCKS` runs of views: of more, the two with the least time between them become one.
    A landmark into which two things went, each seen at another time, can so be parted again.
    """

    _blocks: list[_Block] = field(default_factory=list)

    def add(self, keyframe: int, embedding: np.ndarray, weight: float) -> None:
        """A keyframe showed it.

        Args:
            keyframe: its number; of several detections in one, each is added.
            embedding: (D,) of the detection; one of zeros, which looks like nothing, is left out.
            weight: above 0, as its scores have.

        Raises:
            ValueError: D is not what it was.
        """
        vector = np.asarray(embedding, dtype=np.float64)
        length = float(np.linalg.norm(vector))
        if self._blocks and vector.shape != self._blocks[0].sum.shape:
            raise ValueError(f"embedding must have shape {self._blocks[0].sum.shape}, but got {vector.shape}")
        if length < SHORTEST or not weight > 0.0:
            return
        self._blocks.append(_Block({keyframe}, (weight / length * vector).astype(np.float32), weight))
        self._shorten()

    def absorb(self, other: EmbeddingMean) -> None:
        """Takes over the views of a landmark that turned out to be this one."""
        self._blocks += other._blocks
        self._shorten()

    def take_out(self, keyframes: Iterable[int]) -> EmbeddingMean:
        """What these keyframes showed was something else: that one's mean.

        A run of views goes as a whole, to where most of its keyframes are.
        """
        wanted, stay, go = set(keyframes), [], []
        for block in self._blocks:
            (go if 2 * len(block.keyframes & wanted) > len(block.keyframes) else stay).append(block)
        self._blocks = stay
        return EmbeddingMean(go)

    @property
    def views(self) -> int:
        """Number of keyframes that it is the mean of."""
        return len(set().union(*(block.keyframes for block in self._blocks)))

    def mean(self) -> np.ndarray | None:
        """(D,) float32 of length 1; None where there was none, or where they cancel out."""
        if not self._blocks:
            return None
        total = np.sum([block.sum for block in self._blocks], axis=0, dtype=np.float64)
        length = np.linalg.norm(total)
        if length < SHORTEST * sum(block.weight for block in self._blocks):
            return None
        return np.asarray(total / length, dtype=np.float32)

    def _shorten(self) -> None:
        """Blocks in the order of time, at most `KEPT_BLOCKS`."""
        self._blocks.sort(key=lambda block: min(block.keyframes))
        while len(self._blocks) > KEPT_BLOCKS:
            blocks = self._blocks
            gaps = [min(b.keyframes) - max(a.keyframes) for a, b in pairwise(blocks)]
            k = int(np.argmin(gaps))
            a, b = blocks[k], blocks.pop(k + 1)
            blocks[k] = _Block(a.keyframes | b.keyframes, a.sum + b.sum, a.weight + b.weight)
