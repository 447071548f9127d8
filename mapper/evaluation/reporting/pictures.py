"""Worst cases as pictures: the part of the frame that shows the boxes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ....datasets.frame import BrokenFrame
from ....datasets.sequence import Sequence
from ..result import WorstCase

Box = tuple[float, float, float, float]

SHAPE = 4 / 3  # width over height of every picture
CONTEXT = 1.0  # of the boxes' larger side, shown around them on each side
SMALLEST = 160  # pixels of the frame across a picture, so that tiny boxes keep their surroundings
LARGEST = 400  # pixels across the stored picture; larger crops are shrunk
QUALITY = 80  # of the JPEG


@dataclass(frozen=True, slots=True)
class Picture:
    """A crop of a frame.

    `jpeg` has `width` x `height` pixels. The boxes are xyxy in the same pixels, counted from the picture's outer
    edges; None where there is none.
    """

    jpeg: bytes
    width: int
    height: int
    truth: Box | None
    found: Box | None


def take_pictures(cases: Iterable[WorstCase], sequence: Sequence | None) -> dict[WorstCase, Picture]:
    """A picture of every case that can be seen; a frame that cannot be used has none. Each frame is read once."""
    if sequence is None:
        return {}
    of_frame: dict[int, list[WorstCase]] = defaultdict(list)
    for case in cases:
        if case.frame is not None and 0 <= case.frame < len(sequence):
            of_frame[case.frame].append(case)
    pictures = {}
    for index in sorted(of_frame):
        try:
            color = sequence[index].color
        except BrokenFrame:
            continue
        pictures |= {case: crop(color, case.truth_xyxy, case.found_xyxy) for case in of_frame[index]}
    return pictures


def crop(color: np.ndarray, truth_xyxy: Box | None, found_xyxy: Box | None) -> Picture:
    """The part of an (H, W, 3) RGB image around both boxes (pixel centres at integers); all of it without boxes."""
    import cv2

    height, width = color.shape[:2]
    boxes = [box for box in (truth_xyxy, found_xyxy) if box is not None and np.all(np.isfinite(box))]
    left, top, right, bottom = _window(np.array(boxes), width, height) if boxes else (0, 0, width, height)
    part = color[top:bottom, left:right]
    scale = min(1.0, LARGEST / part.shape[1])
    if scale < 1.0:
        part = cv2.resize(part, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)

    def inside(box: Box | None) -> Box | None:
        """0.5: from pixel centres to edges."""
        if box is None or not np.all(np.isfinite(box)):
            return None
        x1, y1, x2, y2 = (np.asarray(box) + 0.5 - [left, top, left, top]) * scale
        return float(x1), float(y1), float(x2), float(y2)

    _, jpeg = cv2.imencode(".jpg", part[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return Picture(jpeg.tobytes(), part.shape[1], part.shape[0], inside(truth_xyxy), inside(found_xyxy))


def _window(boxes: np.ndarray, width: int, height: int) -> tuple[int, int, int, int]:
    """xyxy in whole pixels about (B, 4) boxes, within the image, of the shape of all pictures where that fits."""
    x1, y1 = boxes[:, :2].min(axis=0).clip(0, [width - 1, height - 1])
    x2, y2 = boxes[:, 2:].max(axis=0).clip(0, [width - 1, height - 1])
    around = CONTEXT * max(x2 - x1, y2 - y1)
    across = max(x2 - x1 + 2 * around, (y2 - y1 + 2 * around) * SHAPE, SMALLEST)
    across = min(across, width, height * SHAPE)
    down = across / SHAPE
    if x2 - x1 > across or y2 - y1 > down:  # an image of another shape, filled by a box
        return 0, 0, width, height
    left = round(float(np.clip((x1 + x2 - across) / 2, 0, width - across)))
    top = round(float(np.clip((y1 + y2 - down) / 2, 0, height - down)))
    return left, top, min(left + round(across), width), min(top + round(down), height)
