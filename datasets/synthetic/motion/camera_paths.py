"""The way of the camera in every preset."""

from __future__ import annotations

import numpy as np

from ..config import Preset
from .along_wall import along_wall
from .arcs import survey
from .orbit import hand_held
from .walk import walk

RATE = 30.0  # Hz, of a camera in the hand
PAUSE = 1.0  # seconds from one way point of a robot to the next
CARRIED = {Preset.TABLETOP: hand_held, Preset.KITCHEN: walk, Preset.LAPS: walk, Preset.WALL: along_wall}


def camera_path(preset: Preset, frames: int, seed: int, pace: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """(N,) stamps in seconds and (N, 4, 4) `T_world_camera`, world z up.

    A longer path begins with the same poses. The scenes are those of `layouts.build_layout`.

    Args:
        preset: whose path.
        frames: N.
        seed: of what differs between paths.
        pace: how many times as fast a carried camera goes, shake and all: at a stamp it is where it is `pace` times as
            late at pace 1. The survey's, which stands still at its way points, has none.
    """
    if preset is Preset.SURVEY:
        return PAUSE * np.arange(frames), survey(frames, seed)
    stamps = np.arange(frames) / RATE
    return stamps, CARRIED[preset](pace * stamps, seed)
