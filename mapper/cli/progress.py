"""How far a run is: a bar on a terminal, a few plain lines anywhere else."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import ProgressColumn

PLAIN_LINES = 10  # at most, for a whole run whose output is not a terminal


class FrameProgress:
    """Frames done, their rate and a note, on stderr; use it as a context manager."""

    def __init__(self, title: str, total: int) -> None:
        self._title, self._total = title, total
        self._bar: Bar | None = None
        self._task: Any = None
        self._start, self._lines = time.perf_counter(), 0

    def __enter__(self) -> FrameProgress:
        self._start = time.perf_counter()
        if sys.stderr.isatty():
            self._bar = _frame_bar()
            self._task = self._bar.add_task(self._title, total=self._total, note="", rate="")
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def show(self, done: int, note: str) -> None:
        """Say that `done` frames are done; `note` is such as "7 things"."""
        rate = f"{done / max(time.perf_counter() - self._start, 1e-6):.1f} frames/s"
        if self._bar is not None:
            self._bar.update(self._task, completed=done, note=note, rate=rate)
        elif done * PLAIN_LINES // self._total > self._lines:
            self._lines = done * PLAIN_LINES // self._total
            print(f"{self._title}: {done}/{self._total} frames, {rate}, {note}", file=sys.stderr, flush=True)


def bar(*columns: ProgressColumn) -> Bar:
    """A bar with these columns after how much is done, on stderr."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    first = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    return Progress(*first, *columns, console=Console(stderr=True))


def _frame_bar() -> Bar:
    from rich.progress import TextColumn, TimeRemainingColumn

    return bar(TextColumn("{task.fields[rate]}"), TextColumn("{task.fields[note]}"), TimeRemainingColumn())
