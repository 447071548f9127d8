"""Images that are needed again and again: as many as fit are kept, the others read anew."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any, Generic, TypeVar

import numpy as np

Item = TypeVar("Item")


class Kept(Generic[Item]):
    """A sequence whose items are read when asked for; the first ones stay, up to a number of bytes.

    Args:
        read: gives the item at an index, the same each time.
        length: number of items.
        limit: bytes of arrays that may be kept.
    """

    def __init__(self, read: Callable[[int], Item], length: int, limit: int) -> None:
        self._read, self._length, self._room = read, length, limit
        self._items: dict[int, Item] = {}

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, index: int) -> Item:
        if index in self._items:
            return self._items[index]
        item = self._read(range(self._length)[index])
        size = _bytes(item)
        if size <= self._room:
            self._room -= size
            self._items[index] = item
        return item

    def __iter__(self) -> Iterator[Item]:
        return (self[index] for index in range(self._length))


def _bytes(item: Any) -> int:
    """Bytes of the arrays of a dataclass; of None, nothing."""
    if item is None:
        return 0
    arrays = (getattr(item, one.name) for one in fields(item))
    return sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))
