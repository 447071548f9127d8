"""The way of the camera in every preset."""

from __future__ import annotations

import numpy as np

from ..config import Preset
from .arcs import survey
from .orbit import hand_held
from .walk import walk

RATE = 30.0  # Hz, of a camera in the hand
PAUSE = 1.0  # seconds from one way point of a robot to the next


def camera_path(preset: Preset, frames: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(N,) stamps in seconds and (N, 4, 4) `T_world_camera`, world z up.

    A longer path begins with the same poses. The scenes are those of `layouts.build_layout`.
    """
    if preset is Preset.SURVEY:
        return PAUSE * np.arange(frames), survey(frames, seed)
    stamps = np.arange(frames) / RATE
    return stamps, (hand_held if preset is Preset.TABLETOP else walk)(stamps, seed)
