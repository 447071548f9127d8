"""Work that can wait: computed in another process, taken over a fixed number of turns later.

    turn        10        11        12        13          lag = 3
    submit      job
    elsewhere   [ - - - - - - - - ]
    due                                       result

A result is never used earlier than its turn, and never later: where it is not there yet, `due` waits for it. A run
therefore gives the same whether the other process is fast, slow or not there at all, and the lag bounds the queue.
"""

from __future__ import annotations

import pickle
import time
import warnings
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from operator import attrgetter
from sys import modules
from typing import Generic, TypeVar

from .deferred_process import PROTOCOL
from .deferred_worker import Worker, WorkerEnded, worker_for

Job = TypeVar("Job")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class DeferredStatistics:
    """What became of the jobs so far.

    Attributes:
        done_there: jobs that the other process computed.
        done_here: jobs that this process computed.
        discarded: jobs whose results were not fetched before `close`.
        waited_ms: milliseconds that `due` and `drain` waited for the other process.
    """

    done_there: int
    done_here: int
    discarded: int
    waited_ms: float


@dataclass(slots=True, eq=False)
class _Outstanding(Generic[Result]):
    turn: int
    payload: bytes  # the pickled job, as it was when submitted
    worker: Worker | None  # None: to be computed here
    future: Future[bytes] | None
    settled: bool = False
    result: Result | None = None
    error: Exception | None = None


class Deferred(Generic[Job, Result]):
    """Results of a function, each a fixed number of turns after its job.

    The first job starts the other process, which all objects for the same function share until this process exits.
    Where it cannot be started or dies, its jobs and all later ones are computed here, at the turn when they are due,
    and a `RuntimeWarning` says so once.

    Args:
        function: at the level of a module other than `__main__`, so that another process can import it; its result
            depends on the job alone, and jobs and results can be pickled.
        lag: turns from a job to its result, >= 0.
        parallel: False computes every job here, at the turn when it is due.

    Raises:
        ValueError: a function that cannot be found by its name, or a negative lag.
    """

    def __init__(self, function: Callable[[Job], Result], lag: int, parallel: bool = True) -> None:
        if lag < 0:
            raise ValueError(f"lag must be 0 or more turns, got {lag}")
        if not _can_be_imported(function):
            raise ValueError(f"{function!r} must be found by its name in a module that another process can import")
        self._function, self._lag, self._parallel = function, lag, parallel
        self._outstanding: deque[_Outstanding[Result]] = deque()
        self._last_turn: int | None = None
        self._closed = False
        self._done_there = self._done_here = self._discarded = 0
        self._waited = 0.0  # s

    def submit(self, turn: int, job: Job) -> None:
        """Takes a job as it is now: later changes to it have no effect. It never waits for the other process.

        Raises:
            ValueError: the turn is before that of the last job.
            RuntimeError: after `close`.
            pickle.PicklingError, TypeError, AttributeError: the job cannot be pickled.
        """
        if self._closed:
            raise RuntimeError("submit after close")
        if self._last_turn is not None and turn < self._last_turn:
            raise ValueError(f"turns must ascend: {turn} after {self._last_turn}")
        payload = pickle.dumps(job, PROTOCOL)
        worker = worker_for(self._function) if self._parallel else None
        future = worker.submit(payload) if worker else None
        self._outstanding.append(_Outstanding(turn, payload, worker, future))
        self._last_turn = turn

    def due(self, turn: int) -> list[Result]:
        """Results of all jobs submitted at turns <= `turn` - lag, in that order, each handed out once.

        Raises:
            Exception: what the function raised, with its traceback in the other process as a note. Only the failed
                job is then gone; the next call gives the other results.
        """
        return self._take(sum(entry.turn <= turn - self._lag for entry in self._outstanding))

    def drain(self) -> list[Result]:
        """Results of all outstanding jobs, as `due` gives them."""
        return self._take(len(self._outstanding))

    def close(self) -> None:
        """Ends the use of this object; results that were not fetched by `drain` are discarded, and counted."""
        self._closed = True
        self._discarded += len(self._outstanding)
        self._outstanding.clear()

    @property
    def pending(self) -> int:
        """Number of jobs whose results were not handed out yet."""
        return len(self._outstanding)

    @property
    def statistics(self) -> DeferredStatistics:
        """Counts and times so far."""
        return DeferredStatistics(self._done_there, self._done_here, self._discarded, 1e3 * self._waited)

    def _take(self, count: int) -> list[Result]:
        taken = [self._outstanding[index] for index in range(count)]
        for entry in taken:
            self._settle(entry)
            if entry.error is not None:
                self._outstanding.remove(entry)
                raise entry.error
        for _ in taken:  # only now: an interrupt while waiting, or an error, loses no result
            self._outstanding.popleft()
        return [entry.result for entry in taken]  # pyright: ignore[reportReturnType]

    def _settle(self, entry: _Outstanding[Result]) -> None:
        """Waits for the answer of the other process, or computes it here."""
        if entry.settled:
            return
        try:
            answer = self._wait(entry)
        except WorkerEnded:
            self._warn(entry.worker)
            answer = None
        if answer is None:
            try:
                entry.result = self._function(pickle.loads(entry.payload))
            except Exception as error:
                entry.error = error
            self._done_here += 1
        else:
            entry.result, entry.error, trace = pickle.loads(answer)
            if entry.error is not None:
                entry.error.add_note(f"In the other process:\n{trace}")
            self._done_there += 1
        entry.settled = True

    def _wait(self, entry: _Outstanding[Result]) -> bytes | None:
        if entry.worker is None or entry.future is None:
            return None
        start = time.perf_counter()
        try:
            return entry.worker.wait_for(entry.future)
        finally:
            self._waited += time.perf_counter() - start

    def _warn(self, worker: Worker | None) -> None:
        words = worker.last_words() if worker else None
        if words:
            warnings.warn(words, RuntimeWarning, stacklevel=5)  # at the caller of `due` or `drain`


def _can_be_imported(function: Callable[..., object]) -> bool:
    module, qualname = getattr(function, "__module__", None), getattr(function, "__qualname__", "")
    if module in (None, "__main__") or module not in modules:
        return False
    try:
        return attrgetter(qualname)(modules[module]) is function
    except AttributeError:
        return False
