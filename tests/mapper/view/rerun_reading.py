"""Reads recordings with rerun's own reader, and catches what is drawn before it gets there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np


class Recorded:
    """The rows of an .rrd file."""

    def __init__(self, file: Path) -> None:
        from rerun.chunk import RrdReader

        reader = RrdReader(file)
        self.chunks = list(reader.store().stream())
        self.layouts = reader.blueprints()

    @property
    def entities(self) -> set[str]:
        return {chunk.entity_path.removeprefix("/") for chunk in self.chunks}

    @property
    def timelines(self) -> set[str]:
        return {name for chunk in self.chunks for name in chunk.timeline_names}

    def rows(self, entity: str, column: str) -> list[tuple[int | None, Any]]:
        """(frame, value) in order of time; None for the frame of what is static."""
        rows = []
        for chunk in self.chunks:
            if chunk.entity_path != f"/{entity}":
                continue
            values = chunk.to_record_batch().to_pydict()
            if column in values:
                frames = values.get("frame", [None] * len(values[column]))
                rows += [(f, v) for f, v in zip(frames, values[column], strict=True) if v is not None]
        return sorted(rows, key=lambda row: -1 if row[0] is None else row[0])

    def latest(self, entity: str, column: str) -> Any:
        return self.rows(entity, column)[-1][1]


class CaughtRecording:
    """In place of a `rerun.RecordingStream`: remembers what was logged."""

    def __init__(self) -> None:
        self.logged: list[tuple[str, tuple[Any, ...], bool]] = []

    def log(self, entity: str, *shapes: Any, static: bool = False) -> None:
        self.logged.append((entity, shapes, static))

    def take(self) -> list[tuple[str, tuple[Any, ...], bool]]:
        """What was logged since the last time."""
        taken, self.logged = self.logged, []
        return taken


def rgb(packed: int) -> tuple[int, int, int]:
    """A colour as rerun stores it."""
    return packed >> 24 & 255, packed >> 16 & 255, packed >> 8 & 255


def numbers(shapes: Any, component: str) -> np.ndarray:
    """A component of something drawn, as an array."""
    return np.array(getattr(shapes, component).as_arrow_array().to_pylist())
