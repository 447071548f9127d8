"""How long each stage of the loop takes."""

from __future__ import annotations

import time
from array import array
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np


class StageClock:
    """Milliseconds per stage; keeps every reading, 4 bytes each."""

    def __init__(self) -> None:
        self._readings: dict[str, array[float]] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Times the block under `name`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self._readings.setdefault(name, array("f")).append(1e3 * (time.perf_counter() - start))

    def latest(self) -> dict[str, tuple[int, float]]:
        """Per stage: how often it was timed so far, and the milliseconds of the last time."""
        return {name: (len(readings), readings[-1]) for name, readings in self._readings.items()}

    def summary(self) -> dict[str, dict[str, float]]:
        """Per stage: count, median_ms, p95_ms, total_s."""
        return {
            name: {
                "count": len(readings),
                "median_ms": round(float(np.median(readings)), 3),
                "p95_ms": round(float(np.percentile(readings, 95)), 3),
                "total_s": round(float(np.sum(readings)) / 1e3, 3),
            }
            for name, readings in self._readings.items()
        }
