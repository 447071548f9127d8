"""Masks as run lengths, the uncompressed RLE of COCO."""

from __future__ import annotations

from dataclasses import dataclass
from operator import index
from typing import Any

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class RunLengths:
    """N masks of one size (height, width).

    `counts` has for each mask the lengths of its runs down the columns, by turns of background and object,
    background first.

    Raises:
        ValueError: for lengths that are no whole numbers from 0 or do not add up to the size.
    """

    size: tuple[int, int]
    counts: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        if min(self.size) < 0:
            raise ValueError(f"mask size {self.size} is negative")
        for counts in self.counts:
            whole = counts.ndim == 1 and np.issubdtype(counts.dtype, np.integer)
            if not whole or (counts < 0).any() or counts.sum() != self.size[0] * self.size[1]:
                raise ValueError(f"mask counts must be whole, from 0, and add up to {self.size[0]} x {self.size[1]}")

    @classmethod
    def encode(cls, mask: np.ndarray) -> RunLengths:
        """From (N, H, W) bool."""
        return cls((mask.shape[1], mask.shape[2]), tuple(_runs(one.T.ravel()) for one in mask))

    def decode(self) -> np.ndarray:
        """To (N, H, W) bool."""
        height, width = self.size
        out = np.zeros((len(self.counts), height, width), dtype=bool)
        for one, counts in zip(out, self.counts, strict=True):
            one[:] = np.repeat(np.arange(len(counts)) % 2 == 1, counts).reshape(width, height).T
        return out

    def to_json(self) -> dict[str, Any]:
        """`size` and `counts`, as COCO names them, with a list of counts a mask."""
        return {"size": list(self.size), "counts": [counts.tolist() for counts in self.counts]}

    @classmethod
    def from_json(cls, value: dict[str, Any]) -> RunLengths:
        """The inverse of `to_json`.

        Raises:
            KeyError, TypeError, ValueError: for anything else.
        """
        height, width = (index(side) for side in value["size"])
        counts = (np.asarray(one) if len(one) else np.zeros(0, dtype=np.int64) for one in value["counts"])
        return cls((height, width), tuple(counts))


def _runs(flat: np.ndarray) -> np.ndarray:
    """Lengths of equal runs of a flat mask; a mask that starts with object starts with 0 background."""
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    runs = np.diff(np.concatenate([[0], changes, [flat.size]]))
    return np.concatenate([[0], runs]) if flat.size and flat[0] else runs
