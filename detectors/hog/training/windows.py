"""The window of a class: how many cells, and how it lies about an object's box.

"The aspect ratio of the detector's bounding box is set to be the tightest box that can be resized to contain all
training images" (Lai et al., IV-A). Boxes are compared at equal area, sqrt(w h) = 1, because that is what the size of
an object in a template means: the window is as wide as the widest and as high as the highest of them, odd ones left
out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...detections import Part
from ...parts import part_box
from .config import TrainConfig


@dataclass(frozen=True, slots=True)
class WindowShape:
    """A window of the whole object.

    Attributes:
        rows, columns: cells; even, so that every half is a window of whole cells.
        width, height: of the window, where the object's box has the area 1.
        margin: share of the window's side left free on every side, at least.
    """

    rows: int
    columns: int
    width: float
    height: float
    margin: float

    def around(self, xyxy: np.ndarray) -> np.ndarray:
        """(..., 4) pixels, windows centred on boxes (..., 4), scaled so that they contain them."""
        boxes = np.asarray(xyxy, dtype=np.float64)
        size = boxes[..., 2:] - boxes[..., :2]
        room = (1.0 - 2.0 * self.margin) * np.array([self.width, self.height])
        unit = np.maximum(np.sqrt(size.prod(axis=-1)), (size / room).max(axis=-1))
        half = 0.5 * unit[..., None] * np.array([self.width, self.height])
        center = 0.5 * (boxes[..., :2] + boxes[..., 2:])
        return np.concatenate([center - half, center + half], axis=-1)

    def cells(self, part: Part) -> tuple[slice, slice]:
        """Rows and columns of the whole window that are the part's window."""
        rows = {Part.TOP: slice(0, self.rows // 2), Part.BOTTOM: slice(self.rows // 2, self.rows)}
        columns = {Part.LEFT: slice(0, self.columns // 2), Part.RIGHT: slice(self.columns // 2, self.columns)}
        return rows.get(part, slice(0, self.rows)), columns.get(part, slice(0, self.columns))


def window_shape(xyxy: np.ndarray, cells: int, margin: float, fit: float) -> WindowShape:
    """The window for (N, 4) boxes of one class, N > 0.

    Args:
        xyxy: boxes with area.
        cells: wanted number.
        margin: see `WindowShape`.
        fit: share of the boxes that are wider, and that are higher, than the window's inside at most: 1 - fit.
    """
    size = np.asarray(xyxy, dtype=np.float64)[:, 2:] - np.asarray(xyxy, dtype=np.float64)[:, :2]
    unit = size / np.sqrt(size.prod(axis=1, keepdims=True))
    width, height = np.quantile(unit, fit, axis=0) / (1.0 - 2.0 * margin)
    rows = _even(np.sqrt(cells * height / width))
    columns = _even(np.sqrt(cells * width / height))
    # Cells are square: the side that rounding made too short for its cells grows.
    pitch = max(width / columns, height / rows)
    return WindowShape(rows, columns, float(pitch * columns), float(pitch * rows), margin)


@dataclass(frozen=True, slots=True, eq=False)
class ClassWindows:
    """The windows of one class: one, or for objects whose boxes differ much in aspect several.

    A lying flashlight is wide, tall or square as one walks around it. A window for all of them would be mostly
    background, and its mean box would fit none.

    Attributes:
        edges: (K - 1,) log aspects, ascending, between one window's objects and the next one's.
        shapes: K windows, the tallest first.
    """

    edges: np.ndarray
    shapes: tuple[WindowShape, ...]

    def number(self, xyxy: np.ndarray) -> np.ndarray:
        """(N,) which of the windows is for each box (N, 4)."""
        return np.searchsorted(self.edges, log_aspect(xyxy), side="right")


def class_windows(xyxy: np.ndarray, config: TrainConfig) -> ClassWindows:
    """Windows for (N, 4) boxes of one class, N > 0: as few as keep each one's aspects within `config.aspects`."""
    aspect = log_aspect(xyxy)
    low, high = np.quantile(aspect, [1.0 - config.fit, config.fit])
    count = int(np.clip(np.ceil((high - low) / np.log(config.aspects)), 1, config.most_windows))
    while True:
        edges = np.linspace(low, high, count + 1)[1:-1]
        number = np.searchsorted(edges, aspect, side="right")
        members = [xyxy[number == k] for k in range(count)]
        if count == 1 or min(len(boxes) for boxes in members) >= config.fewest_boxes:
            return ClassWindows(edges, tuple(window_shape(m, config.cells, config.margin, config.fit) for m in members))
        count -= 1


def log_aspect(xyxy: np.ndarray) -> np.ndarray:
    """(N,) log(width / height) of boxes (N, 4)."""
    size = xyxy[:, 2:] - xyxy[:, :2]
    return np.log(size[:, 0] / size[:, 1])


def part_share(part: Part, window: np.ndarray, xyxy: np.ndarray) -> tuple[float, float, float, float]:
    """The part's box, as shares of the part's window; the mean over (N, 4) windows and (N, 4) boxes of objects."""
    around = part_box(window, part)
    size = np.tile(around[:, 2:] - around[:, :2], 2)
    shares = (part_box(xyxy, part) - np.tile(around[:, :2], 2)) / size
    x0, y0, x1, y1 = shares.mean(axis=0)
    return float(x0), float(y0), float(x1), float(y1)


def _even(value: float) -> int:
    return max(2 * round(value / 2.0), 4)
