"""Our own format, `thingmap-detections/1`: everything that `Detections` hold, exactly.

    {"format": "thingmap-detections/1", "classes": ["cup", "chair"], "frames": [
    {"name": "frame-000000", "xyxy": [[x1, y1, x2, y2]], "scores": [[0.9, 0.1]], "part": [0]},
    ...
    ]}

Boxes are in pixels of the frame. A row of `scores` has a number per class; where only some are known it is
`{"0": 0.9}`, by class number (`null` in a row means the same). `part` is 0 for the whole object, and 1 to 4 for the
top, bottom, left and right half; it may be left out (whole objects). `mask` is
`{"size": [H, W], "counts": [...]}` with the run lengths of each mask, `embedding` is `{"size": D, "values": [[...]]}`.
Numbers have as many digits as reading them back exactly takes.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import InputError
from ..checks import checked_classes
from ..detections import Detections, Part
from .recording import Malformed, ReadOptions, Recording, add_frame, frame_key, within
from .run_lengths import RunLengths

FORMAT = "thingmap-detections/1"


def write_detections(
    path: str | Path, classes: Sequence[str], items: Iterable[tuple[str, Detections]], *, overwrite: bool = False
) -> int:
    """Write detections by frame name, one frame at a time, and return how many frames there were.

    The file appears under its name when it is complete; whatever ends the writing early leaves nothing behind.

    Args:
        path: the new file.
        classes: names, the same for all frames.
        items: (frame name, detections) in any order.
        overwrite: whether an existing file may be replaced.

    Raises:
        InputError: for a file that exists or a folder that does not.
        ValueError: for a frame that comes twice or has other classes.
    """
    path = Path(path)
    if path.exists() and not overwrite:
        raise InputError(path, "a new file", "an existing one", "choose another name or allow overwriting")
    if not path.parent.is_dir():
        raise InputError(path.parent, "a folder to write into", "none", "make the folder first")
    classes, written = checked_classes(classes), set()
    partial = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with partial.open("w", encoding="utf-8") as file:
            head = json.dumps({"format": FORMAT, "classes": classes, "frames": []}, ensure_ascii=False)
            file.write(head.removesuffix("]}"))
            for name, detections in items:
                if frame_key(name) in written:
                    raise ValueError(f"frame {name!r} comes twice")
                if detections.classes != classes:
                    raise ValueError(f"frame {name!r} has other classes than the file")
                file.write(",\n" if written else "\n")
                file.write(json.dumps(_frame_to_json(name, detections), ensure_ascii=False, allow_nan=False))
                written.add(frame_key(name))
            file.write("\n]}\n")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
    return len(written)


def read_thingmap(content: dict[str, Any], path: Path, options: ReadOptions) -> Recording:
    """Read what `write_detections` wrote."""
    if content["format"] != FORMAT:
        raise Malformed(f"format {content['format']!r}")
    classes = checked_classes(content["classes"])
    frames, masks = {}, {}
    for i, item in enumerate(content["frames"]):
        with within(f"frame {i}"):
            key = frame_key(item["name"])
            add_frame(frames, key, _frame_from_json(item, classes))
            if "mask" in item:
                masks[key] = RunLengths.from_json(item["mask"])
                if len(masks[key].counts) != len(frames[key]):
                    raise Malformed(f"{len(masks[key].counts)} masks for {len(frames[key])} boxes")
    return Recording(classes, frames, masks=masks)


def _frame_to_json(name: str, detections: Detections) -> dict[str, Any]:
    item = {
        "name": name,
        "xyxy": detections.xyxy.tolist(),
        "scores": [_row_to_json(row) for row in detections.scores],
        "part": detections.part.tolist(),
    }
    if detections.mask is not None:
        item["mask"] = RunLengths.encode(detections.mask).to_json()
    if detections.embedding is not None:
        item["embedding"] = {"size": detections.embedding.shape[1], "values": detections.embedding.tolist()}
    return item


def _row_to_json(row: np.ndarray) -> list[float] | dict[str, float]:
    known = np.flatnonzero(~np.isnan(row))
    return row.tolist() if len(known) == len(row) else {str(k): float(row[k]) for k in known}


def _frame_from_json(item: dict[str, Any], classes: tuple[str, ...]) -> Detections:
    xyxy = np.array(item["xyxy"] or np.zeros((0, 4)), dtype=np.float64)
    rows = [_row_from_json(row, len(classes)) for row in item["scores"]]
    scores = np.array(rows or np.zeros((0, len(classes))), dtype=np.float64)
    part = np.array(item.get("part", [Part.WHOLE] * len(xyxy)))
    embedding = None
    if "embedding" in item:
        values, size = item["embedding"]["values"], item["embedding"]["size"]
        embedding = np.array(values or np.zeros((0, size)), dtype=np.float32)
        if embedding.shape[1:] != (size,):
            raise Malformed(f"embedding of shape {embedding.shape} with size {size}")
    return Detections(classes, xyxy, scores, part, embedding=embedding)


def _row_from_json(row: list[float] | dict[str, float], classes: int) -> list[float]:
    if isinstance(row, list):
        return row
    values = [float("nan")] * classes
    for k, value in row.items():
        if not 0 <= int(k) < classes:
            raise Malformed(f"class number {k} of {classes} classes")
        values[int(k)] = float(value)
    return values
