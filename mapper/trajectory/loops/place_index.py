"""Which keyframes look like this image: candidates for loop closures, and for finding the way back after being lost.

Every feature of the image votes for the few keyframes that hold the features most like it. Unlike histograms of words,
votes are few where many keyframes compete for a feature that is everywhere, and what two words cannot tell apart the
descriptors' own bits do (Jegou et al. 2008, Hamming embedding).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from ...config import PlaceConfig
from .inverted_file import InvertedFile
from .vocabulary import Vocabulary, packed


@dataclass(frozen=True, slots=True)
class PlaceMatch:
    """A keyframe that may show the same place.

    Attributes:
        keyframe: its number.
        score: share of the image's features that vote for it, 0 to 1, less what an average keyframe gets; so that it
            means the same in small and large maps, and for images with few and many features.
    """

    keyframe: int
    score: float


class PlaceIndex:
    """Keyframes by appearance; grows by one keyframe at a time. The same calls give the same answers."""

    def __init__(self, config: PlaceConfig) -> None:
        self._config = config
        self._vocabulary = _vocabulary()
        self._features = InvertedFile(self._vocabulary.size)
        self._keyframes: list[int] = []  # ascending; its place in the list is a keyframe's slot

    def __len__(self) -> int:
        """Number of keyframes."""
        return len(self._keyframes)

    @property
    def nbytes(self) -> int:
        """Bytes of the features held."""
        return self._features.nbytes

    def add(self, keyframe: int, descriptors: np.ndarray) -> None:
        """Take in a keyframe with its (N, 32) uint8 ORB descriptors.

        Raises:
            ValueError: its number is not above those of before, or descriptors of another shape or type.
        """
        if self._keyframes and keyframe <= self._keyframes[-1]:
            raise ValueError(f"expected a keyframe after {self._keyframes[-1]}, found {keyframe}")
        codes = packed(descriptors)
        self._features.add(len(self._keyframes), self._vocabulary.words(codes), codes)
        self._keyframes.append(keyframe)

    def query(self, descriptors: np.ndarray, count: int = 5, exclude_after: int | None = None) -> list[PlaceMatch]:
        """The keyframes that look most like an image with these (N, 32) uint8 ORB descriptors, best first.

        Of neighbours in the row of keyframes, which look alike, only the best is named; and none below
        `config.min_score`.

        Args:
            count: at most so many.
            exclude_after: only keyframes numbered at most that; None for all.

        Raises:
            ValueError: descriptors of another shape or type.
        """
        codes = packed(descriptors)
        slots = len(self) if exclude_after is None else int(np.searchsorted(self._keyframes, exclude_after, "right"))
        if slots == 0 or len(codes) == 0:
            return []
        c = self._config
        words = self._vocabulary.words(codes)
        asked = self._features.rarest(words, c.max_comparisons)
        votes = self._features.votes(words[asked], codes[asked], slots, c.votes, c.max_distance)
        usual = votes.sum() / (slots + c.unseen)
        scores = (votes - usual) / max(len(asked), 1)
        return [PlaceMatch(self._keyframes[slot], float(scores[slot])) for slot in self._best(scores, count)]

    def _best(self, scores: np.ndarray, count: int) -> list[int]:
        """Slots by score, the older first of equals; a slot next to a better one is left out."""
        best: list[int] = []
        for slot in np.argsort(-scores, kind="stable"):
            if len(best) == count or scores[slot] < self._config.min_score:
                break
            if all(abs(int(slot) - other) > self._config.neighbours for other in best):
                best.append(int(slot))
        return best


@cache
def _vocabulary() -> Vocabulary:
    """The shipped words, read once."""
    return Vocabulary.load()
