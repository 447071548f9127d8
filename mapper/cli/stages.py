"""How far a job of several stages is: a bar for each on a terminal, a plain line for each anywhere else."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any

from .progress import bar

if TYPE_CHECKING:
    from rich.progress import Progress as Bars


class StageProgress:
    """Stages one after the other, on stderr; use it as a context manager."""

    def __init__(self) -> None:
        self._stage = ""
        self._start = time.perf_counter()
        self._bars: Bars | None = None
        self._task: Any = None

    def __enter__(self) -> StageProgress:
        if sys.stderr.isatty():
            from rich.progress import TimeElapsedColumn

            self._bars = bar(TimeElapsedColumn())
            self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bars is not None:
            self._bars.stop()

    def show(self, stage: str, done: int, total: int) -> None:
        """Say that `done` of `total` steps of a stage are done."""
        if stage != self._stage:
            self._stage, self._start = stage, time.perf_counter()
            if self._bars is not None:
                self._task = self._bars.add_task(stage, total=total)
        if self._bars is not None:
            self._bars.update(self._task, completed=done)
        elif done == total:
            print(f"{stage}: {total} in {time.perf_counter() - self._start:.0f} s", file=sys.stderr, flush=True)
