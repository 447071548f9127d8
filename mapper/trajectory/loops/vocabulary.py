"""Words for binary descriptors: a tree of centres, each the bitwise majority of the descriptors nearest to it.

A descriptor's word is the leaf that is reached by going to the nearest centre at every level (Nister and Stewenius
2006; for binary descriptors Galvez-Lopez and Tardos 2012). `benchmarks/place_vocabulary.py` trains the shipped one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit

from ....datasets.errors import InputError

SHIPPED = Path(__file__).with_name("orb_words.npz")
BYTES = 32  # of a descriptor
ITERATIONS = 10  # of k-majority: assignments hardly change after it
FAR = 257  # bits: further than any two descriptors are


@dataclass(frozen=True, slots=True, eq=False)
class Vocabulary:
    """A full tree of centres.

    Attributes:
        branching: K, children of every node.
        centres: (K + K^2 + ... + K^depth, 4) uint64, level after level; the children of a level's node n are the next
            level's K n to K n + K - 1. Where training data had fewer than K kinds, the first child is repeated.
    """

    branching: int
    centres: np.ndarray

    @property
    def size(self) -> int:
        """Number of words, K^depth."""
        nodes = len(self.centres)
        return (nodes * (self.branching - 1) + self.branching) // self.branching

    def words(self, descriptors: np.ndarray) -> np.ndarray:
        """(N,) int64 words of (N, 4) uint64 descriptors, see `packed`."""
        return _words(descriptors, self.centres, self.branching)

    def save(self, path: Path) -> None:
        """As npz: the branching and the centres as bytes; the same vocabulary gives the same arrays."""
        np.savez(path, branching=np.int64(self.branching), centres=self.centres.view(np.uint8))

    @classmethod
    def load(cls, path: Path = SHIPPED) -> Vocabulary:
        """
        Raises:
            InputError: the file is not a vocabulary.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                vocabulary = cls(int(file["branching"]), packed(file["centres"]))
        except (OSError, KeyError, ValueError) as error:
            raise _not_a_vocabulary(path, str(error)) from error
        if vocabulary.branching < 2 or not _is_full(vocabulary):
            raise _not_a_vocabulary(path, f"{len(vocabulary.centres)} centres, branching {vocabulary.branching}")
        return vocabulary


def packed(descriptors: np.ndarray) -> np.ndarray:
    """(N, 32) uint8 descriptors as (N, 4) uint64, whose bits are counted eight bytes at a time.

    Raises:
        ValueError: another shape or type.
    """
    if descriptors.ndim != 2 or descriptors.shape[1] != BYTES or descriptors.dtype != np.uint8:
        raise ValueError(f"expected (N, {BYTES}) uint8 descriptors, found {descriptors.shape} {descriptors.dtype}")
    return np.ascontiguousarray(descriptors).view(np.uint64)


def train_vocabulary(descriptors: np.ndarray, branching: int, depth: int, seed: int = 0) -> Vocabulary:
    """Hierarchical k-majority of (N, 4) uint64 descriptors; the same input and seed give the same words."""
    rng = np.random.default_rng(seed)
    groups, levels = [np.arange(len(descriptors))], []
    for _ in range(depth):
        split = [_split(descriptors, group, branching, rng) for group in groups]
        levels += [centres for centres, _ in split]
        groups = [child for _, children in split for child in children]
    return Vocabulary(branching, np.concatenate(levels))


def _split(
    descriptors: np.ndarray, group: np.ndarray, branching: int, rng: np.random.Generator
) -> tuple[np.ndarray, list[np.ndarray]]:
    """(K, 4) centres of a group and the K groups of those nearest to each."""
    if len(group) == 0:
        return np.zeros((branching, BYTES // 8), dtype=np.uint64), [group] * branching
    members = descriptors[group]
    centres = _seeds(members, branching, rng)
    nearest = _nearest(members, centres)[0]
    for _ in range(ITERATIONS):
        centres = np.stack([_majority(members[nearest == k], centres[k]) for k in range(branching)])
        before, nearest = nearest, _nearest(members, centres)[0]
        if np.array_equal(before, nearest):
            break
    return centres, [group[nearest == k] for k in range(branching)]


def _seeds(members: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """(count, 4) members far from one another (k-means++, Arthur and Vassilvitskii 2007)."""
    chosen = [members[rng.integers(len(members))]]
    distance = _nearest(members, chosen[0][None])[1]
    for _ in range(count - 1):
        odds = distance.astype(np.float64) ** 2
        total = odds.sum()
        chosen.append(members[rng.choice(len(members), p=odds / total)] if total > 0.0 else chosen[0])
        distance = np.minimum(distance, _nearest(members, chosen[-1][None])[1])
    return np.stack(chosen)


def _majority(members: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """(4,) uint64 whose every bit is that of most members."""
    if len(members) == 0:
        return otherwise
    bits = np.unpackbits(members.view(np.uint8), axis=1)
    return np.packbits(2 * bits.sum(axis=0, dtype=np.int64) >= len(members)).view(np.uint64)


def _is_full(vocabulary: Vocabulary) -> bool:
    nodes, level = 0, 1
    while nodes < len(vocabulary.centres):
        level *= vocabulary.branching
        nodes += level
    return 0 < nodes == len(vocabulary.centres)


def _not_a_vocabulary(path: Path, found: str) -> InputError:
    return InputError(
        path, "branching and centres of a full tree of words", found, "train it by benchmarks/place_vocabulary.py"
    )


@njit(cache=True)
def set_bits(x):
    """How many bits of a uint64 are 1, counted in pairs, nibbles, bytes, summed by a product (Warren 2002, ch. 5)."""
    x = x - ((x >> np.uint64(1)) & np.uint64(0x5555555555555555))
    x = (x & np.uint64(0x3333333333333333)) + ((x >> np.uint64(2)) & np.uint64(0x3333333333333333))
    x = (x + (x >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((x * np.uint64(0x0101010101010101)) >> np.uint64(56))


@njit(cache=True)
def _hamming(a, i, b, j):
    """Bits in which rows of two (N, 4) uint64 arrays differ; indexed here, as handing over a row costs more."""
    return (
        set_bits(a[i, 0] ^ b[j, 0])
        + set_bits(a[i, 1] ^ b[j, 1])
        + set_bits(a[i, 2] ^ b[j, 2])
        + set_bits(a[i, 3] ^ b[j, 3])
    )


@njit(cache=True)
def _nearest(descriptors, centres):
    """(N,) which centre is nearest, the first of equals, and (N,) bits to it."""
    index = np.zeros(len(descriptors), dtype=np.int64)
    distance = np.full(len(descriptors), FAR, dtype=np.int64)
    for i in range(len(descriptors)):
        for k in range(len(centres)):
            d = _hamming(descriptors, i, centres, k)
            if d < distance[i]:
                index[i], distance[i] = k, d
    return index, distance


@njit(cache=True)
def _words(descriptors, centres, branching):
    words = np.zeros(len(descriptors), dtype=np.int64)
    for i in range(len(descriptors)):
        node, level, width = 0, 0, branching  # node in its level, where the next level begins, how wide it is
        while level < len(centres):
            first, nearest, child = level + node * branching, FAR, 0
            for k in range(branching):
                d = _hamming(descriptors, i, centres, first + k)
                if d < nearest:
                    nearest, child = d, k
            node = node * branching + child
            level += width
            width *= branching
        words[i] = node
    return words
