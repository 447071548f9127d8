"""The detections of OA-SLAM and VOOM.

`[{"file_name", "detections": [{"category_id", "detection_score", "bbox": [x1, y1, x2, y2]}]}]`, boxes in pixels,
category ids from 0 as YOLO numbers them: COCO's 80 unless names are given. VOOM's `ellipse` is not read. A detection of
a half's template may add its `part`, a number as in our own format.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ..detections import Detections, Part
from ..detections_from import box_of_four
from .reading import class_names
from .recording import ReadOptions, Recording, add_frame, frame_key, within


def read_oaslam(content: list[dict[str, Any]], path: Path, options: ReadOptions) -> Recording:
    """Read a list of frames; `options.names` gives other classes than COCO's 80."""
    classes = class_names(options.names)
    frames: dict[str, Detections] = {}
    for i, item in enumerate(content):
        with within(f"frame {i}"):
            found = item["detections"]
            detections = Detections.from_best_class(
                classes,
                [box_of_four(one["bbox"]) for one in found],
                [one["category_id"] for one in found],
                [one["detection_score"] for one in found],
            )
            part = [one.get("part", Part.WHOLE) for one in found]
            detections = replace(detections, part=part)  # type: ignore[arg-type]
            add_frame(frames, frame_key(item["file_name"]), detections)
    return Recording(classes, frames)
