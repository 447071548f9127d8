"""The parent's side of the other process: one per function, shared, started when first needed, ended at exit.

It is a plain subprocess. `multiprocessing` would run the user's script again where that has no `__main__` guard
(spawn), or copy locks that other threads hold (fork). One thread sends jobs and another receives answers, so that
neither pipe can fill up and block both ends, and nobody waits to hand over a job while the process is busy.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import IO, Any

from . import deferred_process
from .deferred_process import read_message, write_message

POLL = 0.1  # s: a wait without a timeout could not be interrupted on every platform
PATIENCE = 1.0  # s that a process has at exit to finish its job before it is killed
SHOWN = 4000  # bytes of the process's last words in a warning
# one thread each: the other cores are the parent's; set before the libraries are imported, if they ever are
ONE_THREAD = {"NUMBA_NUM_THREADS": "1", "OPENCV_FOR_THREADS_NUM": "1"}


class WorkerEnded(Exception):
    """The other process has ended without an answer."""


class Worker:
    """A process that answers jobs with one function.

    Args:
        module, qualname: names of the function.

    Attributes:
        pid: of the process; None where it could not be started.
    """

    def __init__(self, module: str, qualname: str) -> None:
        self._name = f"{module}.{qualname}"
        self._owner = os.getpid()
        self._lock = threading.Lock()
        self._waiting: dict[int, Future[bytes]] = {}
        self._count = 0
        self._to_send: SimpleQueue[tuple[int, bytes] | None] = SimpleQueue()
        self._threads: tuple[threading.Thread, ...] = ()
        self._ended = self._dismissed = False
        self._last_words: str | None = None
        self._process: subprocess.Popen[bytes] | None = None
        try:
            self._process, self._errors = _start(module, qualname)
        except (OSError, ValueError) as error:  # ValueError: what no argument or variable may contain
            self._ended, self._last_words = True, f"it could not be started: {error}"
            return
        self._threads = tuple(
            threading.Thread(target=loop, args=(self._process,), name=f"deferred-{loop.__name__}", daemon=True)
            for loop in (self._send, self._receive)
        )
        for thread in self._threads:
            thread.start()

    @property
    def pid(self) -> int | None:
        return self._process.pid if self._process else None

    def submit(self, payload: bytes) -> Future[bytes]:
        """Hands over a pickled job and returns at once; `wait_for` gives the pickled answer."""
        future: Future[bytes] = Future()
        with self._lock:
            if self._ended:
                future.set_exception(WorkerEnded())
                return future
            self._count += 1
            self._waiting[self._count] = future
            self._to_send.put((self._count, payload))
        return future

    def wait_for(self, future: Future[bytes]) -> bytes:
        """The answer, when it is there.

        Raises:
            WorkerEnded: there will be none.
        """
        if self._owner != os.getpid():
            raise WorkerEnded  # this process is a fork: it has the pipes, but not the threads that serve them
        while not future.done():
            wait((future,), timeout=POLL)
        return future.result()

    def last_words(self) -> str | None:
        """Why the process ended, told once; None where it lives, was ended on purpose, or was asked before."""
        with self._lock:
            words, self._last_words = self._last_words, None
        return words and f"the process for {self._name} is gone, its work goes on in this one: {words}"

    def end(self) -> None:
        """Ends the process; jobs without an answer get none."""
        self._dismissed = True
        if self._process is not None:
            self._to_send.put(None)
            try:
                self._process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
            for thread in self._threads:
                thread.join()

    def _send(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        with suppress(OSError):  # of a process that has ended, which `_receive` sees
            while (message := self._to_send.get()) is not None:
                write_message(process.stdin, *message)
        with suppress(OSError):
            process.stdin.close()

    def _receive(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        reason = ""
        try:
            while (message := read_message(process.stdout)) is not None:
                number, payload = message
                with self._lock:
                    future = self._waiting.pop(number)
                future.set_result(payload)
        except Exception as error:  # whatever came was no answer: without this, somebody would wait for ever
            reason = f"{error}; "
            process.kill()
        process.stdout.close()
        self._bury(f"{reason}exit code {process.wait()}")

    def _bury(self, reason: str) -> None:
        self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(0, self._errors.tell() - SHOWN))
        said = self._errors.read().decode(errors="replace").strip()
        self._errors.close()
        with self._lock:
            self._ended = True
            orphans, self._waiting = list(self._waiting.values()), {}
            if not self._dismissed:
                self._last_words = f"{reason}\n{said}" if said else reason
        self._to_send.put(None)
        for future in orphans:
            future.set_exception(WorkerEnded())


def _start(module: str, qualname: str) -> tuple[subprocess.Popen[bytes], IO[bytes]]:
    """The process, and the file that its stderr goes to: unlike a pipe, a file needs nobody who reads."""
    # -P and the same search path: the process imports what this one would, not what lies in the current folder
    path = os.pathsep.join(entry or str(Path.cwd()) for entry in sys.path)
    command = [sys.executable or "python", "-P", "-m", deferred_process.__name__, module, qualname]
    environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": path}
    errors = tempfile.TemporaryFile()  # noqa: SIM115 (closed when the process has ended)
    try:
        pipe = subprocess.PIPE
        return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=errors, env=environment), errors
    except BaseException:
        errors.close()
        raise


_workers: dict[tuple[int, str, str], Worker] = {}
_starting = threading.Lock()


def worker_for(function: Callable[[Any], Any]) -> Worker:
    """The worker of a function in this process, started where there is none yet."""
    key = os.getpid(), function.__module__, function.__qualname__
    with _starting:
        if key not in _workers:
            _workers[key] = Worker(*key[1:])
        return _workers[key]


@atexit.register
def end_workers() -> None:
    """Ends every process that this one has started."""
    for key in [key for key in _workers if key[0] == os.getpid()]:
        _workers.pop(key).end()
