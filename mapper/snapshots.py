"""Maps on the way: what was known after so many frames, for whoever asks how a map grows."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ..datasets.errors import UserError
from .map.atomic import write_atomic
from .map.store import OutputFolder
from .runner import Mapper, Progress

SCHEMA = "thingmap-snapshots/1"


class SnapshotWriter:
    """Writes the map, doubtful things included, after given numbers of mapped frames.

    Reading a map takes what is known into it at once (`SemanticMapper.object_map`), so that a run with snapshots may
    differ from one without in the last digits.

    Args:
        folder: of the run; files go to its `snapshots/`, `index.json` among them.
        mapper: what is mapping.
        frames: after how many mapped frames, 1 or more each.
    """

    def __init__(self, folder: OutputFolder, mapper: Mapper, frames: Iterable[int]) -> None:
        self._folder, self._mapper, self._frames = folder, mapper, frozenset(frames)
        self._written: list[dict[str, Any]] = []
        if self._index.is_file():  # an earlier run's snapshots are not this one's
            self._write_index()

    def __call__(self, now: Progress) -> None:
        """To be told of every frame."""
        frames = now.done - now.skipped
        if now.update is None or frames not in self._frames:
            return
        object_map = self._mapper.object_map(include_doubtful=True)  # first: it may move the cameras too
        stamps, poses = self._mapper.trajectory()
        name = f"{frames:06d}.json"
        self._folder.snapshot_folder.mkdir(exist_ok=True)
        object_map.save(self._folder.snapshot_folder / name, include_doubtful=True, evidence=False)
        pose = np.round(poses[-1], 9).tolist()
        self._written.append({"frames": frames, "file": name, "stamp": float(stamps[-1]), "T_world_camera": pose})
        self._write_index()

    @property
    def _index(self) -> Path:
        return self._folder.snapshot_folder / "index.json"

    def _write_index(self) -> None:
        write_atomic(self._index, json.dumps({"schema": SCHEMA, "snapshots": self._written}, indent=1).encode())


def parse_snapshot_frames(text: str) -> tuple[int, ...]:
    """Numbers of frames as the command line has them: "3,7,10".

    Raises:
        UserError: something else.
    """
    try:
        frames = tuple(int(part) for part in text.split(","))
    except ValueError:
        frames = ()
    if not frames or min(frames) < 1:
        raise UserError(f"--snapshots: expected numbers of frames such as 3,7,10, found {text!r}; give at least one")
    return frames
