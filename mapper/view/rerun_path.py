"""The camera's path through the keyframes, and the loop closures between them."""

from __future__ import annotations

from typing import Any

import numpy as np

from .rerun_package import import_rerun

PATH, LOOPS = "world/path", "world/loops"
PIECE = 100  # keyframes of one line, so that a long path is not sent anew with every keyframe
PATH_COLOR, LOOP_COLOR = (70, 130, 220), (230, 60, 200)
LINE_WIDTH = -1.5  # pixels


class PathDrawer:
    """Lines that are drawn anew where keyframes are new or have moved."""

    def __init__(self, recording: Any, static: bool = False) -> None:
        self._rr, self._recording, self._static = import_rerun(), recording, static
        self._loops = np.empty((0, 2), dtype=np.int64)

    def draw(self, moved: np.ndarray, T_world_keyframe: np.ndarray, loops: np.ndarray) -> None:
        """Brings the lines up to date.

        Args:
            moved: (M,) bool, keyframes that are new or elsewhere.
            T_world_keyframe: (M, 4, 4).
            loops: (L, 2) int64, keyframes that closures connect.
        """
        places = T_world_keyframe[:, :3, 3]
        for piece in np.unique(np.flatnonzero(moved) // PIECE):
            # from the last keyframe of the piece before, so that there is no gap
            line = places[max(piece * PIECE - 1, 0) : (piece + 1) * PIECE]
            self._log(f"{PATH}/{piece:04d}", [line], PATH_COLOR)
        if len(self._loops) and not len(loops):
            self._recording.log(LOOPS, self._rr.Clear(recursive=False), static=self._static)
        elif len(loops) and (not np.array_equal(loops, self._loops) or moved[loops].any()):
            self._log(LOOPS, places[loops], LOOP_COLOR)
        self._loops = loops

    def _log(self, entity: str, lines: Any, color: tuple[int, int, int]) -> None:
        shapes = self._rr.LineStrips3D(lines, colors=color, radii=LINE_WIDTH)
        self._recording.log(entity, shapes, static=self._static)
