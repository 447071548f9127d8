"""What a run did: frames used and skipped, times, memory."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, slots=True)
class StageTime:
    """Milliseconds that one stage took, over all frames."""

    mean_ms: float
    median_ms: float
    p95_ms: float
    total_ms: float

    @classmethod
    def of(cls, milliseconds: list[float]) -> StageTime:
        if not milliseconds:
            return cls(0.0, 0.0, 0.0, 0.0)
        values = np.asarray(milliseconds)
        median, p95 = np.percentile(values, (50.0, 95.0))
        return cls(float(values.mean()), float(median), float(p95), float(values.sum()))


@dataclass(frozen=True, slots=True)
class RunReport:
    """The account of one run.

    Attributes:
        source: name of the sequence.
        frames_total: in the sequence.
        frames_used: handed to the mapper.
        keyframes: of those used.
        things: in the map after the last frame.
        skipped: problem -> the frames that had it, named, in order.
        stopped: None after a whole run, else why and where it ended, such as "interrupted at frame 17".
        seconds: wall time of the loop.
        stages: "reading" is the time that the loop waited for frames, "mapping" the time in the mapper.
        peak_memory_mb: of the process so far; None where the system does not tell.
    """

    source: str
    frames_total: int
    frames_used: int
    keyframes: int
    things: int
    skipped: Mapping[str, tuple[str, ...]]
    stopped: str | None
    seconds: float
    stages: Mapping[str, StageTime]
    peak_memory_mb: float | None

    @property
    def frames_skipped(self) -> int:
        return sum(len(names) for names in self.skipped.values())

    @property
    def frames_per_second(self) -> float:
        return self.frames_used / self.seconds if self.seconds > 0.0 else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; times in milliseconds to 3 decimals, seconds and megabytes to 2."""
        stages = {
            name: {key: round(value, 3) for key, value in asdict(stage).items()} for name, stage in self.stages.items()
        }
        return {
            "source": self.source,
            "frames_total": self.frames_total,
            "frames_used": self.frames_used,
            "frames_skipped": self.frames_skipped,
            "skipped": {problem: list(names) for problem, names in self.skipped.items()},
            "keyframes": self.keyframes,
            "things": self.things,
            "stopped": self.stopped,
            "seconds": round(self.seconds, 2),
            "frames_per_second": round(self.frames_per_second, 2),
            "stages": stages,
            "peak_memory_mb": None if self.peak_memory_mb is None else round(self.peak_memory_mb, 2),
        }


def peak_memory_mb() -> float | None:
    """Largest resident size of this process so far, in MB (10^6 bytes); None where the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1 if sys.platform == "darwin" else 1024  # macOS counts bytes, Linux kibibytes
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
