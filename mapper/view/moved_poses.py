"""Which keyframes have moved since somebody last looked."""

from __future__ import annotations

import numpy as np

SHIFT, TURN = 2e-3, 2e-3  # m, rad: at 3 m from a camera 6 mm, less than a third of a voxel of the live cloud


class MovedPoses:
    """Remembers keyframe poses as they were last shown.

    Every update of the graph moves every pose by a little; what is drawn follows only where it can be seen.
    """

    def __init__(self) -> None:
        self._shown = np.empty((0, 4, 4))

    def moved(self, T_world_keyframe: np.ndarray) -> np.ndarray:
        """(M,) bool: which of the (M, 4, 4) poses are new or elsewhere; they count as shown from now on."""
        known = len(self._shown)
        now, old = T_world_keyframe[:known], self._shown
        trace = (now[:, :3, :3] * old[:, :3, :3]).sum(axis=(1, 2))  # of R_now R_old^T
        turned = np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)) > TURN
        shifted = np.linalg.norm(now[:, :3, 3] - old[:, :3, 3], axis=1) > SHIFT
        moved = np.concatenate([turned | shifted, np.ones(len(T_world_keyframe) - known, dtype=bool)])
        self._shown = np.concatenate([self._shown, T_world_keyframe[known:]])
        self._shown[moved] = T_world_keyframe[moved]
        return moved
