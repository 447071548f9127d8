"""Ctrl-C between two frames instead of in the middle of one."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def stop_on_interrupt() -> Iterator[Callable[[], bool]]:
    """Gives a function that says whether Ctrl-C was pressed; a second Ctrl-C raises `KeyboardInterrupt` at once.

    A mapper that is interrupted while it changes its graph has no consistent map to save, so the first one waits for
    the end of the frame. Outside the main thread, which gets no signals, and in a program that was started to ignore
    them, the function always says no.
    """
    before = signal.getsignal(signal.SIGINT) or signal.default_int_handler
    if threading.current_thread() is not threading.main_thread() or before is signal.SIG_IGN:
        yield lambda: False
        return
    asked = threading.Event()

    def handle(_signal: int, _frame: Any) -> None:
        asked.set()
        signal.signal(signal.SIGINT, before)
        print("\nstopping after this frame; press Ctrl-C again to stop at once", file=sys.stderr)

    signal.signal(signal.SIGINT, handle)
    try:
        yield asked.is_set
    finally:
        signal.signal(signal.SIGINT, before)
