"""A small frame for tests of evidence: a wall in two planes."""

from __future__ import annotations

import numpy as np

from thingmap.datasets.frame import Frame, Intrinsics

CLASSES = ("cup", "bowl", "book")


def make_frame(left: float = 1.2, right: float = 1.0) -> Frame:
    """32 x 24 pixels; columns below 14 are at `left` metres, the others at `right`."""
    depth = np.full((24, 32), right, dtype=np.float32)
    depth[:, :14] = left
    intrinsics = Intrinsics(32, 24, 60.0, 62.0, 15.3, 11.8)
    return Frame(0, "frame-0", 0.0, np.full((24, 32, 3), 90, np.uint8), depth, intrinsics, np.eye(4))
