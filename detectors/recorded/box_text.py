"""Text files of boxes of one class: `x y w h score` a line, in pixels, as cuboid SLAM data sets record them.

Their names say nothing but a number (`0012_yolo2_0.15.txt`), so a frame is matched by the number that its own name
starts with.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...datasets.errors import UserError
from ..detections import Detections
from .reading import read_rows
from .recording import Malformed, MatchedBy, ReadOptions, Recording, add_frame, leading_number, within


def read_boxes(path: Path, options: ReadOptions) -> Recording:
    """Read a folder of text files whose names start with a number; `options.label` names the class.

    Raises:
        UserError: without a label.
    """
    if not options.label:
        raise UserError(f"{path}: boxes without a class need a label, such as label=cabinet")
    frames: dict[int, Detections] = {}
    for file in sorted(path.glob("*.txt")):
        number = leading_number(file.name)
        if number is not None:
            with within(file.name):
                rows = read_rows(file, (5,))
                corners = np.concatenate([rows[:, :2], rows[:, :2] + rows[:, 2:4]], axis=1)
                found = Detections.from_best_class((options.label,), corners, np.zeros(len(rows)), rows[:, 4])
                add_frame(frames, number, found)
    if not frames:
        raise Malformed("no .txt files whose names start with a number")
    return Recording((options.label,), frames, MatchedBy.NUMBER)
