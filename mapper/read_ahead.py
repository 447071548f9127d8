"""Reading frames in a background thread while the mapper works on the one before."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from dataclasses import dataclass

from ..datasets.frame import BrokenFrame, Frame
from ..datasets.sequence import Sequence

POLL = 0.1  # s, how soon a stop is noticed by a thread that waits


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """What came of reading one position of the sequence: a frame, or the reason why it cannot be used."""

    position: int
    result: Frame | BrokenFrame


class ReadAhead:
    """Iterates over a sequence in order, at most `ahead` frames in front of the consumer.

    Use it as a context manager: leaving it ends the thread. An exception of the sequence other than `BrokenFrame` is
    raised where the consumer would have received that frame. Decoding images releases the GIL, so reading costs the
    consumer only what it cannot hide.
    """

    def __init__(self, sequence: Sequence, ahead: int = 4) -> None:
        self._sequence = sequence
        self._queue: queue.Queue[Reading | BaseException | None] = queue.Queue(maxsize=ahead)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read_all, name="read-ahead", daemon=True)

    def __enter__(self) -> ReadAhead:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def __iter__(self) -> Iterator[Reading]:
        while True:
            item = self._next()
            if item is None:
                return
            if isinstance(item, BaseException):
                raise item
            yield item

    def _next(self) -> Reading | BaseException | None:
        while True:  # a wait without a timeout could not be interrupted on every platform
            try:
                return self._queue.get(timeout=POLL)
            except queue.Empty:
                continue

    def _read_all(self) -> None:
        try:
            for position in range(len(self._sequence)):
                if not self._offer(self._read(position)):
                    return
            self._offer(None)
        except BaseException as error:  # handed to the consumer, which raises it
            self._offer(error)

    def _read(self, position: int) -> Reading:
        try:
            return Reading(position, self._sequence[position])
        except BrokenFrame as problem:
            return Reading(position, problem)

    def _offer(self, item: Reading | BaseException | None) -> bool:
        while not self._stop.is_set():
            try:
                self._queue.put(item, timeout=POLL)
                return True
            except queue.Full:
                continue
        return False
