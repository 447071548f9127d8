"""What is called what in one image, against the truth: by the evaluator's rules, and by the paper's of background."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thingmap.datasets.errors import UserError
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.detectors.boxes import box_ious
from thingmap.mapper.evaluation.boxes.image_boxes import EDGE, TrueBoxes, found_boxes, true_boxes
from thingmap.mapper.evaluation.boxes.matching import Matches, match_boxes
from thingmap.mapper.evaluation.config import EvaluationConfig

BACKGROUND = -1  # class of what is called no object
JUDGED = EvaluationConfig()


@dataclass(frozen=True, slots=True, eq=False)
class Called:
    """N proposals of a frame: which are truly no object, and with what score each is called one (0: it is not).

    Proposals on objects that are hardly visible are left out.
    """

    is_background: np.ndarray
    score: np.ndarray


def judge_called(
    xyxy: np.ndarray, class_id: np.ndarray, score: np.ndarray, truth: GroundTruth, index: int
) -> tuple[Matches, Called]:
    """Proposals with what they are called.

    Args:
        xyxy: (N, 4) pixels, from the image's outer edges.
        class_id: (N,) index into the truth's classes, or `BACKGROUND`.
        score: (N,) of that class.
        truth: of the scene.
        index: of the frame.
    """
    assert truth.intrinsics is not None
    true, named = truth_of(truth, index), class_id != BACKGROUND
    found = found_boxes(xyxy[named] - EDGE, class_id[named], score[named], truth.intrinsics)
    boxes = found_boxes(xyxy - EDGE, class_id, np.where(named, score, 0.0), truth.intrinsics)
    overlap = np.maximum(box_ious(boxes.xyxy, true.whole), box_ious(boxes.xyxy, true.visible)) >= JUDGED.box_iou
    on_fair, on_any = overlap[:, true.fair].any(axis=1), overlap.any(axis=1)
    judged = on_fair | ~on_any
    return match_boxes(found, true, JUDGED.box_iou, index), Called(~on_any[judged], boxes.score[judged])


def truth_of(truth: GroundTruth, index: int) -> TrueBoxes:
    """The objects of a frame.

    Raises:
        UserError: nobody knows what can be seen in it.
    """
    seen = None if truth.frame_truth is None else truth.frame_truth(index)
    if seen is None or truth.intrinsics is None:
        raise UserError(f"{truth.name}: nothing is known of frame {index}; render the scene again")
    return true_boxes(seen, truth, truth.intrinsics, JUDGED.min_visibility)


def class_numbers(classes: tuple[str, ...], truth: GroundTruth) -> np.ndarray:
    """(K,) index into the truth's classes of each of the detector's; `BACKGROUND` where the truth has none."""
    known = [truth.classes.index(name) if name in truth.classes else BACKGROUND for name in classes]
    return np.array(known, dtype=np.int64)
