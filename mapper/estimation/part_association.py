"""Detections of object parts that show nothing known: which of them are of one object.

A half template answers on the objects that a whole one misses, so that a new object may be seen by its parts only. The
boxes of whole objects that they imply say which of them belong together.
"""

from __future__ import annotations

import numpy as np

from ...detectors.boxes import box_ious
from ...detectors.detections import Part
from .association_costs import DetectionArrays

# Implied boxes of one object overlap by this much at least. Where two halves are known to a tenth of their sides, their
# wholes are to a fifth, and overlap by half; neighbours of like size have to stand within half their width for it. With
# boxes known to a twentieth, in 18 rendered scenes, of 5,923 parts that were joined 5,915 were rightly.
SAME_OBJECT = 0.4


def join_parts(
    detections: DetectionArrays, target: np.ndarray, duplicate_of: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Lets the part detections that show nothing known go with other detections of the same object.

    Surest first, each goes with the detection whose whole box its own overlaps most at like depth: one of a known
    target, a whole one, or a surer part that leads its group. With none of these it leads a group itself.

    Args:
        detections: N of one keyframe.
        target, duplicate_of: (N,) as in `Assignment`, before this.

    Returns:
        duplicate_of: (N,), with the parts that go with a detection of a known target.
        same_as: (N,) index of the detection that a part goes with, which itself goes with none; -1 elsewhere.
    """
    duplicate_of, same_as = duplicate_of.copy(), np.full(len(target), -1)
    shown = np.where(target >= 0, target, duplicate_of)
    leads = (detections.part == Part.WHOLE) | (shown >= 0)
    open_parts = np.flatnonzero(~leads)
    if not len(open_parts):
        return duplicate_of, same_as
    together = _overlaps_at_like_depth(detections)
    for i in open_parts[np.argsort(-detections.confidence[open_parts], kind="stable")]:
        overlap = np.where(leads, together[i], 0.0)
        best = int(np.argmax(overlap))
        if overlap[best] <= SAME_OBJECT:
            leads[i] = True
        elif shown[best] >= 0:
            duplicate_of[i] = shown[best]
        else:
            same_as[i] = best
    return duplicate_of, same_as


def _overlaps_at_like_depth(detections: DetectionArrays) -> np.ndarray:
    """(N, N) intersection over union of the whole boxes; 0 where one lies behind the other.

    Ranges may differ by their noise (1 sigma), and by half a width: the top half of a bowl shows its far rim, the lower
    half its near side.
    """
    apart = np.abs(detections.ranges[:, None] - detections.ranges[None])
    noise = np.hypot(detections.sigma_range[:, None], detections.sigma_range[None])
    depth = (detections.half_widths[:, None] + detections.half_widths[None]) / 2.0
    return np.where(apart <= noise + depth, box_ious(detections.whole_xyxy, detections.whole_xyxy), 0.0)
