"""How benchmarks time their stages, and tell of those of a long job."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable


def least_ms(work: Callable[[], object], repeats: int) -> float:
    """Least milliseconds of CPU of so many calls; one more before them compiles what there is to compile."""
    work()
    costs = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        costs.append(time.process_time() - start)
    return 1000.0 * min(costs)


class StageLines:
    """A line on stderr for every stage that is done: a training's `on_progress`."""

    def __init__(self) -> None:
        self._start = time.perf_counter()

    def __call__(self, stage: str, done: int, total: int) -> None:
        if done == total:
            seconds = time.perf_counter() - self._start
            self._start = time.perf_counter()
            print(f"{stage}: {total} in {seconds:.0f} s", file=sys.stderr, flush=True)
