"""What is found and what is true in one image, as boxes that can be compared.

All boxes here have pixel centres at integers, as those of the truth: an image spans [-0.5, W - 0.5] x [-0.5, H - 0.5].
All are clipped to it: no detector draws beyond the image, so neither truth nor map may.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....datasets.frame import Intrinsics
from ....datasets.ground_truth import GroundTruth
from ....datasets.truth import FrameTruth
from ....detectors.boxes import EDGE
from ....detectors.detections import Detections, Part
from ..inputs.case import Case
from ..result import NotEvaluated


@dataclass(frozen=True, slots=True, eq=False)
class FoundBoxes:
    """N boxes that a detector or a map claims in an image.

    Attributes:
        xyxy: (N, 4) pixels, clipped.
        class_id: (N,) index into the truth's classes.
        score: (N,) by which they are ranked.
        inside: (N,) share of each box's area, before clipping, that lies in the image.
        source: (N,) which of the detections, or of the things, each one is.
    """

    xyxy: np.ndarray
    class_id: np.ndarray
    score: np.ndarray
    inside: np.ndarray
    source: np.ndarray

    def __len__(self) -> int:
        return len(self.xyxy)


@dataclass(frozen=True, slots=True, eq=False)
class TrueBoxes:
    """M objects of the truth's classes that are at least partly in an image.

    Attributes:
        object_id: (M,) `TrueObject.id`.
        class_id: (M,) index into the truth's classes.
        whole: (M, 4) pixels, box of the whole silhouette, clipped.
        visible: (M, 4) pixels, box of what can be seen, clipped; NaN where nothing can.
        visibility: (M,) share of the whole silhouette that can be seen.
        fair: (M,) bool: seen well enough to be found; the others are nobody's fault.
    """

    object_id: np.ndarray
    class_id: np.ndarray
    whole: np.ndarray
    visible: np.ndarray
    visibility: np.ndarray
    fair: np.ndarray

    def __len__(self) -> int:
        return len(self.object_id)


def clip_boxes(xyxy: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """(N, 4) boxes cut to the image; one wholly outside becomes a line or a point on the border, NaN stays NaN."""
    return np.clip(xyxy, -EDGE, np.array([intrinsics.width, intrinsics.height] * 2) - EDGE)


def box_areas(xyxy: np.ndarray) -> np.ndarray:
    """(N,) square pixels; 0 for a box without inside, NaN for a NaN one."""
    return np.maximum(xyxy[:, 2] - xyxy[:, 0], 0.0) * np.maximum(xyxy[:, 3] - xyxy[:, 1], 0.0)


def inside_share(xyxy: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """(N,) share of each box's area that lies in the image; NaN for a box without area, and for a NaN one."""
    with np.errstate(invalid="ignore"):
        return box_areas(clip_boxes(xyxy, intrinsics)) / box_areas(xyxy)


def found_boxes(xyxy: np.ndarray, class_id: np.ndarray, score: np.ndarray, intrinsics: Intrinsics) -> FoundBoxes:
    """Clip (N, 4) boxes with their (N,) classes and scores; those without area in the image, and NaN ones, go."""
    whole = np.asarray(xyxy, dtype=np.float64).reshape(-1, 4)
    clipped = clip_boxes(whole, intrinsics)
    kept = np.flatnonzero(box_areas(clipped) > 0.0)
    return FoundBoxes(
        xyxy=clipped[kept],
        class_id=np.asarray(class_id, dtype=np.int64)[kept],
        score=np.asarray(score, dtype=np.float64)[kept],
        inside=inside_share(whole[kept], intrinsics),
        source=kept,
    )


def detected_boxes(detections: Detections, case: Case, intrinsics: Intrinsics) -> FoundBoxes:
    """The detector's boxes of whole objects, each once: as its best class, by the score of that.

    Boxes of parts, and of classes that the truth does not know, are left out.
    """
    known = [case.to_truth_label(name) for name in detections.classes]
    column = np.array([-1 if label is None else case.truth.classes.index(label) for label in known], dtype=np.int64)
    class_id = column[detections.class_id] if len(detections) else np.zeros(0, dtype=np.int64)
    kept = (detections.part == Part.WHOLE) & (class_id >= 0)
    return found_boxes(detections.xyxy[kept] - EDGE, class_id[kept], detections.confidence[kept], intrinsics)


def true_boxes(seen: FrameTruth, truth: GroundTruth, intrinsics: Intrinsics, min_visibility: float) -> TrueBoxes:
    """The objects of the truth's classes in a frame; fair are those visible by at least `min_visibility`."""
    class_of = {thing.id: truth.classes.index(thing.label) for thing in truth.objects}
    rows = np.array([row for row, id_ in enumerate(seen.object_id) if int(id_) in class_of], dtype=np.int64)
    object_id = np.asarray(seen.object_id, dtype=np.int64)[rows]
    visibility = np.asarray(seen.visibility, dtype=np.float64)[rows]
    return TrueBoxes(
        object_id=object_id,
        class_id=np.array([class_of[int(id_)] for id_ in object_id], dtype=np.int64),
        whole=clip_boxes(np.asarray(seen.xyxy, dtype=np.float64).reshape(-1, 4)[rows], intrinsics),
        visible=clip_boxes(np.asarray(seen.xyxy_visible, dtype=np.float64).reshape(-1, 4)[rows], intrinsics),
        visibility=visibility,
        fair=visibility >= min_visibility,
    )


def check_boxes(truth: GroundTruth) -> None:
    """Raise `NotEvaluated` unless boxes in images can be judged by this truth."""
    if truth.frame_truth is None:
        raise NotEvaluated("the truth does not say what can be seen in the frames")
    if truth.intrinsics is None:
        raise NotEvaluated("the truth does not know the camera")
    if not truth.complete:
        raise NotEvaluated("the truth does not name every object, so a box that is none of them need not be false")


def frame_boxes(case: Case, frame: int) -> TrueBoxes | None:
    """What is true in a frame of the truth; None where it is not annotated. The truth has passed `check_boxes`."""
    truth = case.truth
    assert truth.frame_truth is not None and truth.intrinsics is not None
    seen = truth.frame_truth(frame)
    return None if seen is None else true_boxes(seen, truth, truth.intrinsics, case.config.min_visibility)
