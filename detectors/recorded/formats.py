"""Which recorded formats there are, how to tell them apart, and reading any of them."""

from __future__ import annotations

from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import Any

from ...datasets.errors import InputError, UserError
from .box_text import read_boxes
from .coco_json import read_coco
from .oaslam_json import read_oaslam
from .reading import load_json
from .recording import Malformed, ReadOptions, Recording, within
from .thingmap_json import read_thingmap
from .yolo_text import read_yolo


class RecordedFormat(Enum):
    """A format of recorded detections; the module of the same name describes it."""

    THINGMAP = "thingmap"
    COCO = "coco"
    OASLAM = "oaslam"
    YOLO = "yolo"
    BOXES = "boxes"


_JSON_READERS = {
    RecordedFormat.THINGMAP: read_thingmap,
    RecordedFormat.COCO: read_coco,
    RecordedFormat.OASLAM: read_oaslam,
}
_FOLDER_READERS = {RecordedFormat.YOLO: read_yolo, RecordedFormat.BOXES: read_boxes}
_USES = {
    RecordedFormat.THINGMAP: set(),
    RecordedFormat.COCO: {"images"},
    RecordedFormat.OASLAM: {"names"},
    RecordedFormat.YOLO: {"names"},
    RecordedFormat.BOXES: {"label"},
}


def read_recording(path: Path, wanted: RecordedFormat | None, options: ReadOptions) -> tuple[RecordedFormat, Recording]:
    """Read recorded detections in the wanted format, or in the one that the content shows.

    Raises:
        InputError: for a missing path or a content that is not as its format says.
        UserError: for an option that the format has no use for.
    """
    if not path.exists():
        raise InputError(path, "recorded detections", "no such file or folder", "check the path")
    in_folder = path.is_dir()
    if wanted is not None and (wanted in _FOLDER_READERS) is not in_folder:
        kinds = ("a folder", "a file") if in_folder else ("a file", "a folder")
        raise InputError(path, f"{kinds[1]} for format {wanted.value}", kinds[0], "check the path and the format")
    content = None if in_folder else load_json(path)
    format_ = wanted or (RecordedFormat.YOLO if in_folder else _guess(content, path))
    _check_options(path, format_, options)
    try:
        if format_ in _FOLDER_READERS:
            return format_, _FOLDER_READERS[format_](path, options)
        with within():
            return format_, _JSON_READERS[format_](content, path, options)
    except Malformed as error:
        remedy = "correct the file, or give its format"
        raise InputError(path, f"detections in format {format_.value}", str(error), remedy) from None


def _guess(content: Any, path: Path) -> RecordedFormat:
    """The format that the first entries of a JSON file show."""
    if isinstance(content, dict) and "format" in content:
        return RecordedFormat.THINGMAP
    if isinstance(content, dict) and "annotations" in content:
        return RecordedFormat.COCO
    first = content[0] if isinstance(content, list) and content else None
    if isinstance(first, dict) and "image_id" in first:
        return RecordedFormat.COCO
    if isinstance(first, dict) and "detections" in first:
        return RecordedFormat.OASLAM
    kind = "an empty list" if content == [] else {dict: "an object", list: "a list"}.get(type(content), "one value")
    shown = content if isinstance(content, dict) else first if isinstance(first, dict) else {}
    found = kind + (f" with {', '.join(list(shown)[:5])}" if shown else "")
    expected = "our own, COCO's or OA-SLAM's detections"
    raise InputError(path, expected, found, "give the format, or convert the file to one of these")


def _check_options(path: Path, format_: RecordedFormat, options: ReadOptions) -> None:
    unused = sorted(name for name, value in asdict(options).items() if value is not None and name not in _USES[format_])
    if unused:
        known = ", ".join(sorted(_USES[format_])) or "none"
        raise UserError(f"{path}: format {format_.value} has no use for {', '.join(unused)}; it takes {known}")
