"""The other process of deferred work: reads jobs from stdin, answers on stdout, one at a time and in order.

`python -m thingmap.mapper.deferred_process MODULE QUALNAME` is started by `deferred_worker`; MODULE.QUALNAME is the
function that every job is given to. A message is a header (mark, number of the job, length) and that many bytes of
pickle: a job one way, `(result, error, traceback)` the other. Only the function's own module is imported.
"""

from __future__ import annotations

import faulthandler
import importlib
import os
import pickle
import signal
import struct
import sys
import threading
import time
import traceback
from collections.abc import Callable
from functools import reduce
from typing import IO, Any

PROTOCOL = 5  # of pickle
MARK = b"tmdf"  # begins every message, so that anything else in the pipe is noticed
HEADER = struct.Struct("<4sQQ")  # mark, number, length
PARENT_CHECK = 0.5  # s between two looks whether the parent still lives


def write_message(stream: IO[bytes], number: int, payload: bytes) -> None:
    """Writes one message and flushes it; `OSError` where nobody reads any more."""
    stream.write(HEADER.pack(MARK, number, len(payload)))
    stream.write(payload)
    stream.flush()


def read_message(stream: IO[bytes]) -> tuple[int, bytes] | None:
    """Waits for a message: its number and its bytes; None at the end of the stream.

    Raises:
        EOFError: the stream ends within a message.
        ValueError: what comes is not a message.
    """
    header = stream.read(HEADER.size)
    if not header:
        return None
    if len(header) < HEADER.size:
        raise EOFError("the stream ends within a header")
    mark, number, length = HEADER.unpack(header)
    if mark != MARK:
        raise ValueError(f"expected a message, found {header!r}")
    payload = stream.read(length)
    if len(payload) < length:
        raise EOFError("the stream ends within a message")
    return number, payload


def find_function(module: str, qualname: str) -> Callable[[Any], Any]:
    """Imports a function by the names of its module and of its place there."""
    return reduce(getattr, qualname.split("."), importlib.import_module(module))  # pyright: ignore[reportReturnType]


def answer_job(function: Callable[[Any], Any], payload: bytes) -> bytes:
    """Pickled `(result, None, "")`, or `(None, error, traceback)` of whatever the function raised."""
    try:
        return pickle.dumps((function(pickle.loads(payload)), None, ""), PROTOCOL)
    except Exception as error:
        return pickle.dumps((None, _that_travels(error), traceback.format_exc()), PROTOCOL)


def _that_travels(error: Exception) -> Exception:
    """The error itself, or its text where it cannot be pickled and read again."""
    try:
        pickle.loads(pickle.dumps(error, PROTOCOL))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _own_pipes() -> tuple[IO[bytes], IO[bytes]]:
    """stdin and stdout for messages alone: what a function prints goes to stderr, and it has nothing to read."""
    jobs, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return jobs, answers


def _end_with_parent(parent: int) -> None:
    # stdin ends with the parent too, but that is noticed only between two jobs
    while os.getppid() == parent:
        time.sleep(PARENT_CHECK)
    os._exit(1)


def main() -> None:
    """Answers jobs until stdin ends or the parent dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; it is for the parent to stop
    faulthandler.enable()  # where native code crashes, stderr says in which call
    threading.Thread(target=_end_with_parent, args=(os.getppid(),), daemon=True).start()
    jobs, answers = _own_pipes()
    function = find_function(*sys.argv[1:3])
    try:
        while (message := read_message(jobs)) is not None:
            number, payload = message
            write_message(answers, number, answer_job(function, payload))
    except (BrokenPipeError, EOFError):
        pass  # the parent died: nobody is left to tell
    os._exit(0)  # there is nothing to tidy up, and tearing down large libraries takes time


if __name__ == "__main__":
    main()
