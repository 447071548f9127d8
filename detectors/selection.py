"""What detectors that choose among many boxes are told."""

from __future__ import annotations

from ..datasets.errors import UserError


def check_selection(confidence: float, max_detections: int, nms_iou: float = 0.0) -> None:
    """Thresholds in [0, 1], and a number of boxes.

    Raises:
        UserError: a share outside [0, 1], or no detection wanted.
    """
    for name, share in (("confidence", confidence), ("nms_iou", nms_iou)):
        if not 0.0 <= share <= 1.0:
            raise UserError(f"{name} must be in [0, 1], but is {share}")
    if max_detections < 1:
        raise UserError(f"max_detections must be at least 1, but is {max_detections}")
