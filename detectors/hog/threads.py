"""Work on several cores: numba's kernels and numpy's products let other threads run meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
_WORKERS = 2  # more gain little: memory limits them, and a mapper has other work for the other cores


def in_threads(work: Callable[[_Item], _Result], items: Iterable[_Item]) -> list[_Result]:
    """`work` of every item, in order; begin with the longest, and the threads end together."""
    with ThreadPoolExecutor(_WORKERS) as pool:
        return list(pool.map(work, items))
