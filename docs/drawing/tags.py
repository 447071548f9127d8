"""Tags: where each has room, and how it is written there."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from .pen import INK, WHITE, Pen
from .scene import Color

WEIGHT = 500  # of OpenCV's variable font: between regular (400) and bold (600)
# Places tried for a tag's centre, from the anchor, in heights of the tag
STEPS_X, STEPS_Y = np.arange(-12.0, 12.1, 0.5), np.arange(-14.0, 10.1, 0.5)


def write_tags(pen: Pen, texts: Sequence[str], colors: Sequence[Color], boxes: np.ndarray) -> int:
    """A text near each of the (N, 8, 2) projected boxes, tied to it; returns how many did not fit."""
    font, height, pad = cv2.FontFace("sans"), round(17 * pen.unit), round(8 * pen.unit)
    widths = [cv2.getTextSize((1 << 14, 1 << 9), text, (0, 0), font, height, WEIGHT)[2] for text in texts]
    sizes = np.array([(width + 3.6 * pad, height + 1.1 * pad) for width in widths])
    anchors = boxes[:, 4:].mean(axis=1)
    outlines = np.concatenate([boxes.min(axis=1), boxes.max(axis=1)], axis=1)
    places = place_tags(anchors, sizes, outlines, (pen.image.shape[1], pen.image.shape[0]))
    found = np.flatnonzero(np.isfinite(places[:, 0])).tolist()
    for i in found:  # all ties before the first tag: none crosses a text
        _tie(pen, places[i], anchors[i], boxes[i], colors[i])
    for i in found:
        x0, y0, x1, y1 = np.round(places[i]).astype(int).tolist()
        _plate(pen, (x0, y0, x1, y1), pad // 2)
        middle = (y0 + y1) // 2
        cv2.circle(pen.image, (x0 + round(1.4 * pad), middle), round(0.62 * pad), colors[i], cv2.FILLED, cv2.LINE_AA)
        start = (x0 + round(2.6 * pad), middle + round(0.36 * height))
        cv2.putText(pen.image, texts[i], start, WHITE, font, height, WEIGHT)
    return len(texts) - len(found)


def _tie(pen: Pen, place: np.ndarray, anchor: np.ndarray, box: np.ndarray, color: Color) -> None:
    """The shortest line from a tag to its (8, 2) box: to the anchor from above, else to any corner."""
    ends = anchor[None] if place[3] < anchor[1] else box
    ties = np.clip(ends, place[:2], place[2:])
    nearest = np.argmin(np.linalg.norm(ties - ends, axis=1))
    leader = np.stack([ends[nearest], ties[nearest]])
    pen.strokes([leader], INK, 2.6, 0.4)
    pen.strokes([leader], color, 1.2)


def _plate(pen: Pen, place: tuple[int, int, int, int], r: int) -> None:
    """What a text is written on: dark, with corners of radius `r` pixels."""
    x0, y0, x1, y1 = place
    low, high = (x0 + r, y0 + r), (x1 - r, y1 - r)
    over = pen.image.copy()
    cv2.rectangle(over, low, high, INK, cv2.FILLED)
    cv2.rectangle(over, low, high, INK, 2 * r, cv2.LINE_AA)  # a wide stroke has round corners
    cv2.addWeighted(over, 0.85, pen.image, 0.15, 0.0, pen.image)


def place_tags(anchors: np.ndarray, sizes: np.ndarray, boxes: np.ndarray, bounds: tuple[int, int]) -> np.ndarray:
    """Where tags go: near their anchors, rather above them, off the boxes if possible, and never on each other.

    Args:
        anchors: (N, 2) pixels; the first ones choose first.
        sizes: (N, 2) width and height of the tags.
        boxes: (N, 4) xyxy of what the tags belong to; better left uncovered, a tag's own a little less so.
        bounds: width and height of the image.

    Returns:
        (N, 4) xyxy, NaN for a tag that found no place.
    """
    places = np.full((len(anchors), 4), np.nan)
    dx, dy = (grid.ravel() for grid in np.meshgrid(STEPS_X, STEPS_Y))
    for i, (anchor, size) in enumerate(zip(anchors, sizes, strict=True)):
        unit = size[1]
        low = anchor - size / 2.0 + unit * np.column_stack([dx, dy])
        tried = np.concatenate([low, low + size], axis=1)
        free = np.all(tried[:, :2] >= 0.2 * unit, axis=1) & np.all(
            tried[:, 2:] <= np.array(bounds) - 0.2 * unit, axis=1
        )
        for other in places[np.isfinite(places[:, 0])]:
            free &= overlap(tried, other + 0.15 * unit * np.array([-1.0, -1.0, 1.0, 1.0])) <= 0.0
        covered = sum((overlap(tried, box) for box in boxes), -0.25 * overlap(tried, boxes[i])) / np.prod(size)
        cost = np.hypot(dx, dy) + 2.0 * (dy > -0.5) + 8.0 * covered
        if free.any():
            places[i] = tried[np.argmin(np.where(free, cost, np.inf))]
    return places


def overlap(boxes: np.ndarray, box: np.ndarray) -> np.ndarray:
    """(N,) area that each of the (N, 4) xyxy has in common with one (4,)."""
    sides = np.minimum(boxes[:, 2:], box[2:]) - np.maximum(boxes[:, :2], box[:2])
    return np.prod(np.maximum(sides, 0.0), axis=1)
