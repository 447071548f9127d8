"""Binary descriptors by word, so that a feature is compared with the few stored ones that may be like it.

The features of a word lie in a chain of blocks, oldest first: adding never moves what is there, and a chain is read
almost from front to back.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .vocabulary import set_bits

BLOCK = 16  # features; half a block per word is wasted
GROWTH = 1.25  # of the space for blocks, when it is full
NONE = -1


class InvertedFile:
    """For every word, the features of it that were added and the slot (place in order of adding) each belongs to."""

    def __init__(self, words: int) -> None:
        self._first = np.full(words, NONE, dtype=np.int32)  # block of each word
        self._last = np.full(words, NONE, dtype=np.int32)
        self._count = np.zeros(words, dtype=np.int64)  # features
        self._used = 0  # blocks
        self._next = np.empty(0, dtype=np.int32)  # block after each block
        self._slots = np.empty((0, BLOCK), dtype=np.int32)
        self._descriptors = np.empty((0, BLOCK, 4), dtype=np.uint64)

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        words = self._first.nbytes + self._last.nbytes + self._count.nbytes
        return words + self._next.nbytes + self._slots.nbytes + self._descriptors.nbytes

    def add(self, slot: int, words: np.ndarray, descriptors: np.ndarray) -> None:
        """(N,) words and (N, 4) uint64 descriptors of a slot, which must not be below those of before."""
        self._make_room(len(words))
        self._used = _append(
            slot,
            words,
            descriptors,
            self._first,
            self._last,
            self._count,
            self._used,
            self._next,
            self._slots,
            self._descriptors,
        )

    def rarest(self, words: np.ndarray, comparisons: int) -> np.ndarray:
        """(M,) which of (N,) words to ask for first: the rarest, as many as cost so many comparisons together."""
        counts = self._count[words]
        order = np.argsort(counts, kind="stable")
        return order[np.cumsum(counts[order]) <= comparisons]

    def votes(
        self, words: np.ndarray, descriptors: np.ndarray, slots: int, nearest: int, max_distance: int
    ) -> np.ndarray:
        """(slots,) int64: how many of these features have a slot, of the first `slots`, among their nearest few.

        A feature votes for the `nearest` slots whose closest feature of the same word differs least from it, by at most
        `max_distance` bits; of equals for the older ones.
        """
        votes = np.zeros(slots, dtype=np.int64)
        _vote(words, descriptors, nearest, max_distance, self._first, self._next, self._slots, self._descriptors, votes)
        return votes

    def _make_room(self, blocks: int) -> None:
        """Space for so many more blocks, as many as there are features: each could open one."""
        needed = self._used + blocks
        if needed <= len(self._next):
            return
        size = max(needed, int(GROWTH * len(self._next)))
        self._next = _grown(self._next, self._used, size)
        self._slots = _grown(self._slots, self._used, size)
        self._descriptors = _grown(self._descriptors, self._used, size)


def _grown(array: np.ndarray, used: int, size: int) -> np.ndarray:
    result = np.empty((size, *array.shape[1:]), dtype=array.dtype)
    result[:used] = array[:used]
    return result


@njit(cache=True)
def _append(slot, words, descriptors, first, last, count, used, following, slots, stored):
    """Puts features at the ends of their chains; returns how many blocks are in use now."""
    for i in range(len(words)):
        word = words[i]
        place = count[word] % BLOCK
        if place == 0:
            if count[word] == 0:
                first[word] = used
            else:
                following[last[word]] = used
            last[word], following[used] = used, NONE
            slots[used, :] = np.iinfo(np.int32).max  # places that are not filled: no slot is that low
            used += 1
        slots[last[word], place] = slot
        stored[last[word], place] = descriptors[i]
        count[word] += 1
    return used


@njit(cache=True)
def _vote(words, descriptors, nearest, max_distance, first, following, slots, stored, votes):
    chosen = np.empty(nearest, dtype=np.int64)
    distances = np.empty(nearest, dtype=np.int64)
    for i in range(len(words)):
        a, b, c, d = descriptors[i, 0], descriptors[i, 1], descriptors[i, 2], descriptors[i, 3]
        chosen[:], distances[:] = NONE, max_distance + 1
        limit = max_distance + 1
        block = np.int64(first[words[i]])
        while block >= 0:
            for place in range(BLOCK):
                distance = set_bits(a ^ stored[block, place, 0]) + set_bits(b ^ stored[block, place, 1])
                if distance >= limit:  # most are too far already by half of their bits
                    continue
                distance += set_bits(c ^ stored[block, place, 2]) + set_bits(d ^ stored[block, place, 3])
                if distance < limit and slots[block, place] < len(votes):
                    _keep(slots[block, place], distance, chosen, distances)
                    limit = distances[nearest - 1]
            block = np.int64(following[block]) if slots[block, BLOCK - 1] < len(votes) else NONE
        for k in range(nearest):
            if distances[k] <= max_distance:
                votes[chosen[k]] += 1


@njit(cache=True)
def _keep(slot, distance, chosen, distances):
    """Puts a slot that is nearer than the last into the list of the nearest, after its equals, and in it only once."""
    last = len(chosen) - 1
    for k in range(len(chosen)):
        if chosen[k] == slot:
            if distances[k] <= distance:
                return
            last = k  # its own entry makes way
            break
    k = last
    while k > 0 and distances[k - 1] > distance:
        chosen[k], distances[k] = chosen[k - 1], distances[k - 1]
        k -= 1
    chosen[k], distances[k] = slot, distance
