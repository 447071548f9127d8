"""What the networks of the YOLO families put out, turned into boxes and full score vectors."""

from __future__ import annotations

from enum import Enum

import numpy as np

STRIDES = (8, 16, 32)
"""Pixels between the cells of the three output grids, finest first; the same in all families."""


class OutputFamily(Enum):
    """How boxes and scores are laid out, for K classes and N cells over the three grids.

    - `YOLOX` (1, N, 5+K): centre offset from the cell in cells, log size in cells, objectness, class scores.
    - `YOLOX_DECODED` (1, N, 5+K): the same exported with the decoding inside: centre and size in pixels. Its shape
      is YOLOX's, so it has to be asked for.
    - `YOLOV5` (1, 3N, 5+K), three anchors a cell: centre and size in pixels, objectness, class scores (YOLOv7 too).
    - `YOLOV8` (1, 4+K, N): centre and size in pixels, class scores, no objectness (YOLO11 too).
    """

    YOLOX = "yolox"
    YOLOX_DECODED = "yolox-decoded"
    YOLOV5 = "yolov5"
    YOLOV8 = "yolov8"

    @property
    def is_yolox(self) -> bool:
        """Trained on images in the top left corner, BGR 0-255; the others on centred ones, RGB 0-1."""
        return self in (OutputFamily.YOLOX, OutputFamily.YOLOX_DECODED)

    def class_count(self, shape: tuple[int, ...]) -> int:
        """K of an output of this shape."""
        return shape[1] - 4 if self is OutputFamily.YOLOV8 else shape[2] - 5


def family_of(shape: tuple[int, ...], width: int, height: int) -> OutputFamily | None:
    """The family of an output of this shape for an input of this size in pixels; None where it fits none."""
    if len(shape) != 3 or shape[0] != 1:
        return None
    cells = sum((width // stride) * (height // stride) for stride in STRIDES)
    if shape[2] == cells and shape[1] > 4:
        return OutputFamily.YOLOV8
    if shape[2] > 5 and shape[1] in (cells, 3 * cells):
        return OutputFamily.YOLOX if shape[1] == cells else OutputFamily.YOLOV5
    return None


def decode(output: np.ndarray, family: OutputFamily, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Boxes (N, 4) xyxy in pixels of an input of width x height, and scores (N, K), from one output (1, ., .).

    Where the network tells objectness and class apart, a score is their product: P(object) P(class | object).
    """
    rows = output[0].astype(np.float64)
    if family is OutputFamily.YOLOV8:
        rows = rows.T
        scores = rows[:, 4:]
    else:
        scores = rows[:, 4:5] * rows[:, 5:]
    centre, size = rows[:, :2], rows[:, 2:4]
    if family is OutputFamily.YOLOX:
        cell, stride = _grid(width, height)
        centre = (centre + cell) * stride
        # A log size beyond e^20 cells is rubbish; the bound keeps it finite and clipping does the rest.
        size = np.exp(np.minimum(size, 20.0)) * stride
    return np.concatenate([centre - size / 2, centre + size / 2], axis=1), scores


def _grid(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Cell (N, 2) as column and row, and stride (N, 1) in pixels, of all grids, row by row, finest first."""
    cells, strides = [], []
    for stride in STRIDES:
        row, column = np.mgrid[: height // stride, : width // stride]
        cells.append(np.stack([column.ravel(), row.ravel()], axis=1))
        strides.append(np.full((row.size, 1), stride))
    return np.concatenate(cells), np.concatenate(strides)
