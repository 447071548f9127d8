"""YOLO's text labels: a folder with `labels/NAME.txt`, or the text files themselves.

A line is `class cx cy w h [confidence]`, the box in units of the image's width and height; without a confidence it
is a label made by people, with score 1. An image in which nothing was found usually has no file. Class names are
those given, else those of `classes.txt`, `data.yaml` or `dataset.yaml` in the folder, else COCO's 80.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..detections import Detections
from .reading import class_names, read_rows
from .recording import Malformed, ReadOptions, Recording, add_frame, frame_key, within

_NAMES = ("classes.txt", "data.yaml", "dataset.yaml")


def read_yolo(path: Path, options: ReadOptions) -> Recording:
    """Read a folder of labels; `options.names` gives the class names."""
    labels = path / "labels" if (path / "labels").is_dir() else path
    folders = (labels, labels.parent) if labels.name == "labels" else (labels,)
    beside = (folder / name for folder in folders for name in _NAMES)
    classes = class_names(options.names or next((file for file in beside if file.is_file()), None))
    files = [file for file in sorted(labels.glob("*.txt")) if file.name not in _NAMES]
    if not files:
        raise Malformed("no .txt files")
    frames: dict[str, Detections] = {}
    for file in files:
        with within(file.name):
            add_frame(frames, frame_key(file.stem), _detections(read_rows(file, (5, 6)), classes))
    return Recording(classes, frames, normalised=True)


def _detections(rows: np.ndarray, classes: tuple[str, ...]) -> Detections:
    centre, size = rows[:, 1:3], rows[:, 3:5]
    if (np.abs(rows[:, 1:5] - 0.5) > 0.501).any():  # 0..1, and a little more from rounding
        raise Malformed("a box that is not in units of the image, 0 to 1 (for `x y w h score` give format=boxes)")
    confidence = rows[:, 5] if rows.shape[1] == 6 else np.ones(len(rows))
    corners = np.concatenate([centre - size / 2, centre + size / 2], axis=1)
    return Detections.from_best_class(classes, corners, rows[:, 0], confidence)
