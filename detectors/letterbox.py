"""An image fitted into a network's input without changing its proportions, and boxes taken back out of it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

GREY = 114
"""Value of the border, as YOLOX and Ultralytics train with it."""


@dataclass(frozen=True, slots=True)
class Letterbox:
    """Where an image of `source` size lies inside an input of `target` size; all are (width, height) in pixels.

    Attributes:
        scaled: size of the resized image inside the target.
        offset: (x, y) of its top left corner there.
    """

    source: tuple[int, int]
    target: tuple[int, int]
    scaled: tuple[int, int]
    offset: tuple[int, int]

    @classmethod
    def fit(cls, source: tuple[int, int], target: tuple[int, int], *, centred: bool) -> Letterbox:
        """The largest that fits: in the top left corner (YOLOX), or in the middle (YOLOv5, YOLOv8)."""
        ratio = min(target[0] / source[0], target[1] / source[1])
        width, height = (max(1, round(side * ratio)) for side in source)
        offset = ((target[0] - width) // 2, (target[1] - height) // 2) if centred else (0, 0)
        return cls(source, target, (width, height), offset)

    def image(self, color: np.ndarray) -> np.ndarray:
        """(h, w, 3) uint8 of the source size to (H, W, 3) uint8 of the target size, grey around it."""
        out = np.full((self.target[1], self.target[0], 3), GREY, dtype=np.uint8)
        (x, y), (width, height) = self.offset, self.scaled
        out[y : y + height, x : x + width] = cv2.resize(color, self.scaled, interpolation=cv2.INTER_LINEAR)
        return out

    def to_source(self, xyxy: np.ndarray) -> np.ndarray:
        """(N, 4) boxes in target pixels to source pixels, not clipped."""
        # The resized sides are whole pixels, so the two axes differ a little from the common ratio.
        scale = np.array([self.source[0] / self.scaled[0], self.source[1] / self.scaled[1]])
        return (xyxy - np.tile(self.offset, 2)) * np.tile(scale, 2)
