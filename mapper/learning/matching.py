"""Which detection shows which known object (Meger et al., Clutter, section IV).

"Our learning procedure associates image space detections to 3D annotated objects by assigning the closest object if
there is significant overlap. If no overlapping object exists, a false detection is indicated."
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...detectors.detections import Part
from ...detectors.parts import part_box


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Result for N detections and M objects.

    Attributes:
        object: (N,) index of the object a detection shows, -1 where it is none.
        duplicate: (N,) bool; it shows an object that another detection of the same template fits better. Such a
            detection is neither one of the object's nor a false one.
        detection: (M, 5) index of the detection that shows the object, by template; -1 where it is missed.
    """

    object: np.ndarray
    duplicate: np.ndarray
    detection: np.ndarray


def match(boxes: np.ndarray, part: np.ndarray, whole: np.ndarray, seen: np.ndarray, overlap: float) -> Matches:
    """Each detection is assigned to the closest object it overlaps, at most one an object and template.

    Args:
        boxes: (N, 4) pixels, boxes of the detections.
        part: (N,) their templates, 0..4.
        whole: (M, 4) pixels, projected boxes of the objects, clipped to the image; NaN where not in view.
        seen: (M, 4) pixels, boxes of what can be seen of them; NaN where unknown.
        overlap: least intersection over union with either box of an object, or with its half for a half template.
    """
    result = Matches(np.full(len(boxes), -1), np.zeros(len(boxes), bool), np.full((len(whole), len(Part)), -1))
    for template in Part if len(whole) else ():
        rows = np.flatnonzero(part == template)
        if not len(rows):
            continue
        halves = part_box(whole, int(template))
        targets = np.stack([halves, _intersection(halves, seen) if template else seen])  # (2, M, 4)
        fits, distance = _compare(boxes[rows], targets)
        distance[fits < overlap] = np.inf
        closest = np.argmin(distance, axis=1)
        reached = np.isfinite(distance[np.arange(len(rows)), closest])
        fit = fits[np.arange(len(rows)), closest]
        result.object[rows] = np.where(reached, closest, -1)
        for k in np.flatnonzero(reached)[np.argsort(-fit[reached], kind="stable")]:
            taken = result.detection[closest[k], template] >= 0
            result.duplicate[rows[k]] = taken
            if not taken:
                result.detection[closest[k], template] = rows[k]
    return result


def _compare(boxes: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, M) best overlap with one of the (2, M, 4) boxes of each object, and centre distance to it over the scale."""
    common = _area(_intersection(boxes[:, None, None], targets[None]))  # (N, 2, M)
    iou = np.nan_to_num(common / (_area(boxes)[:, None, None] + _area(targets)[None] - common))
    shift = _centre(boxes)[:, None, None] - _centre(targets)[None]
    scale = np.sqrt(np.maximum(_area(boxes), 1.0))[:, None, None]
    distance = np.nan_to_num(np.linalg.norm(shift, axis=-1) / scale, nan=np.inf)
    best = np.argmax(iou, axis=1)[:, None]
    return np.take_along_axis(iou, best, axis=1)[:, 0], np.take_along_axis(distance, best, axis=1)[:, 0]


def _intersection(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(..., 4) common box; corners cross where there is none."""
    low, high = np.maximum(first[..., :2], second[..., :2]), np.minimum(first[..., 2:], second[..., 2:])
    return np.concatenate([low, high], axis=-1)


def _centre(xyxy: np.ndarray) -> np.ndarray:
    """(..., 2) pixels."""
    return (xyxy[..., :2] + xyxy[..., 2:]) / 2.0


def _area(xyxy: np.ndarray) -> np.ndarray:
    """(...) pixels; 0 where corners cross, NaN where unknown."""
    return np.maximum(xyxy[..., 2:] - xyxy[..., :2], 0.0).prod(axis=-1)
