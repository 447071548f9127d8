"""Boxes held against the points of the things that they show: how far these reach in the image, and each thing once.

Labelled points say more of a box than whether its class is right (Lai et al., IV-C): what a detector draws and how far
a thing's own points reach are two measurements of one outline, and of two boxes on one thing one is too many.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...detectors.boxes import EDGE, box_ious
from ...detectors.detections import Detections, Part
from .box_votes import central_votes


@dataclass(frozen=True, slots=True, eq=False)
class ThingPixels:
    """Where points of things appear in an image.

    Attributes:
        uv: (V, 2) pixels, whole numbers at centres.
        number: (V,) of each point's thing, 0 for none.
    """

    uv: np.ndarray
    number: np.ndarray


def shown_things(
    detections: Detections, claimed: np.ndarray, seen: ThingPixels, label: np.ndarray, central: float
) -> np.ndarray:
    """(D,) int64 number of the thing that each box shows, 0 for none and for boxes of parts.

    It is that of most points of the box's class in the middle of the box; where there are none, in all of it.

    Args:
        detections: D boxes.
        claimed: (D,) label that each is for.
        seen: V points that the frame sees.
        label: (V,) of these points.
        central: share of the width and height that is the middle.
    """
    shown = np.zeros(len(detections), dtype=np.int64)
    for k in np.unique(claimed):
        rows = np.flatnonzero((claimed == k) & (detections.part == Part.WHOLE))
        taken = (label == k) & (seen.number > 0)
        numbers, column = np.unique(seen.number[taken], return_inverse=True)
        for share in (1.0, central):
            votes = central_votes(detections.xyxy[rows], seen.uv[taken], column, len(numbers), share)
            some = votes.any(axis=1)
            shown[rows[some]] = numbers[votes[some].argmax(axis=1)]
    return shown


def reaches(pixels: ThingPixels, wanted: np.ndarray, least: int) -> np.ndarray:
    """(D, 4) boxes around all points of the things of these (D,) numbers; NaN for 0 and for fewer points than `least`.

    They count from the image's outer edge, as a detector's.
    """
    boxes = np.full((len(wanted), 4), np.nan)
    for number in np.unique(wanted[wanted > 0]):
        uv = pixels.uv[pixels.number == number]
        if len(uv) >= least:
            boxes[wanted == number] = np.concatenate([uv.min(axis=0), uv.max(axis=0)]) + EDGE
    return boxes


def drawn_anew(xyxy: np.ndarray, extents: Sequence[np.ndarray], same: float, drawn: float) -> np.ndarray:
    """(D, 4) boxes on the way to the extents that each has most in common with; NaN where that is too little.

    Detectors draw what they see or, of what is half hidden, all of it: both are extents that a box may have meant.

    Args:
        xyxy: (D, 4) boxes.
        extents: several (D, 4) that a box may be of, NaN for none.
        same: intersection over union from which on a box and extents are of one outline.
        drawn: share of the way.
    """
    anew, most = np.full(xyxy.shape, np.nan), np.full(len(xyxy), same)
    for there in extents:
        common = np.diagonal(box_ious(xyxy, there))
        nearer = common >= most
        most = np.where(nearer, common, most)
        anew[nearer] = (1.0 - drawn) * xyxy[nearer] + drawn * there[nearer]
    return anew


def doubles(detections: Detections, shown: np.ndarray) -> np.ndarray:
    """(D,) bool: boxes on a thing (its number, 0 for none) of which a box of more confidence says the same class."""
    is_double, best = np.zeros(len(detections), dtype=bool), set()
    for row in np.argsort(-detections.confidence, kind="stable"):
        claim = int(shown[row]), int(detections.class_id[row])
        is_double[row] = claim in best
        if claim[0]:
            best.add(claim)
    return is_double
