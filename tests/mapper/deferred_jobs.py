"""Functions for the tests of deferred work; one each where a test ends the process of its function."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import NoReturn

import numpy as np


class Unpicklable(Exception):
    """Holds what no pickle can."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.lock = threading.Lock()


def square(value: float) -> float:
    return value * value


def slow_square(value: float) -> float:
    time.sleep(0.05)
    return value * value


def where(_job: object) -> tuple[int, int]:
    """Process, and its parent."""
    return os.getpid(), os.getppid()


def also_where(job: object) -> tuple[int, int]:
    return where(job)


def doubled(image: np.ndarray) -> np.ndarray:
    time.sleep(0.02)
    return 2.0 * image


def spoil(values: list[int]) -> list[int]:
    """Changes its own job, as a function should not."""
    values.append(len(values))
    return values


def root(value: float) -> float:
    if value < 0.0:
        raise ValueError(f"no root of {value}")
    return value**0.5


def lose(text: str) -> NoReturn:
    raise Unpicklable(text)


def chatter(text: str) -> str:
    """Writes where only messages belong, and reads what is not there."""
    print(text)
    os.write(1, text.encode())
    return sys.stdin.read() + text


def die_at(job: tuple[int, int, int]) -> int:
    """(value, fatal value, process that survives): the value."""
    value, fatal, survivor = job
    if value == fatal and os.getpid() != survivor:
        os.write(2, b"cannot bear it")
        os.kill(os.getpid(), signal.SIGKILL)
    return value


def nap(seconds: float) -> int:
    time.sleep(seconds)
    return os.getpid()


def nap_alone(seconds: float) -> int:
    return nap(seconds)


def threads(_job: object) -> tuple[int, int]:
    """Of OpenCV and of numba."""
    import cv2
    import numba

    return cv2.getNumThreads(), numba.get_num_threads()


def wait_for_file(job: tuple[str, str]) -> str:
    """(started, go): makes the first file, waits for the second."""
    started, go = map(Path, job)
    started.touch()
    while not go.exists():
        time.sleep(0.01)
    return go.read_text()
