"""2D boxes annotated in the videos of Washington RGB-D Scenes v1.

Two forms: the distribution's `desk_1.mat`, and a table of all videos with rows
`no  scene  subfolder  image_id  object  label  box` separated by tabs, box `(x, y, w, h)`.

Both count pixels from 1, as MATLAB does, and right = x + w. Here pixel centres are integers from 0: one is subtracted.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import InputError
from .tables import read_text

_COLUMNS = ("scene", "subfolder", "image_id", "object", "label", "box")


@dataclass(frozen=True, slots=True, eq=False)
class LabelledBoxes:
    """The annotated boxes of one frame.

    Attributes:
        xyxy: (N, 4) float64 pixels.
        classes: N class names, such as "coffee_mug".
        instances: N names of the objects themselves, such as "coffee_mug_5".
    """

    xyxy: np.ndarray
    classes: tuple[str, ...]
    instances: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.xyxy)

    @staticmethod
    def none() -> LabelledBoxes:
        """No box: the annotation of a frame in which no object is seen."""
        return LabelledBoxes(np.zeros((0, 4)), (), ())


def read_boxes_tsv(path: Path) -> dict[str, dict[int, LabelledBoxes]]:
    """Boxes by video (such as "desk_1") and frame number (from 1); a frame without boxes is absent.

    Raises:
        InputError: the file is missing, or a row is not as above.
    """
    text = read_text(path, "a table of boxes", "check the path")
    rows = csv.DictReader(text.splitlines(), delimiter="\t")
    if missing := [column for column in _COLUMNS if column not in (rows.fieldnames or ())]:
        expected = f"columns {', '.join(_COLUMNS)}, separated by tabs"
        raise InputError(path, expected, f"no {', '.join(missing)}", "give the table of boxes")
    videos: dict[str, dict[int, list[tuple[str, str, list[float]]]]] = {}
    for row in rows:
        try:
            x, y, w, h = (float(value) for value in row["box"].strip("()").split(","))
            number = int(row["image_id"])
        except (AttributeError, TypeError, ValueError):
            found = f"{row['image_id']!r}, {row['box']!r} in line {rows.line_num}"
            raise InputError(path, "a frame number and a box (x, y, w, h)", found, "correct the line") from None
        frame = videos.setdefault(row["subfolder"], {}).setdefault(number, [])
        frame.append((row["object"], row["label"], [x, y, x + w, y + h]))
    return {video: {number: _boxes(rows) for number, rows in frames.items()} for video, frames in videos.items()}


def read_boxes_mat(path: Path) -> Mapping[int, LabelledBoxes]:
    """Boxes of a video by frame number (from 1); a frame without boxes is absent.

    The file holds `bboxes`, a cell for each frame with a struct array of fields category, instance, top, bottom, left
    and right.

    Raises:
        InputError: the file is missing, or is not as above.
    """
    from scipy.io import loadmat  # slow to import, and needed for this form only
    from scipy.io.matlab import MatReadError

    form = "a MATLAB file with `bboxes`, a cell for each frame of structs category, instance, top, bottom, left, right"
    if not path.is_file():
        raise InputError(path, form, "no such file", "download the annotations of the dataset")
    try:
        cells = loadmat(path)["bboxes"].ravel()
        frames = {
            number: [
                (_text(s["category"]), f"{_text(s['category'])}_{int(s['instance'].item())}", _corners(s))
                for s in cell.ravel()
            ]
            for number, cell in enumerate(cells, start=1)
            if cell.size
        }
    except (MatReadError, NotImplementedError, OSError, KeyError, ValueError, TypeError, IndexError) as error:
        raise InputError(path, form, f"{type(error).__name__}: {error}", "download the file again") from None
    return {number: _boxes(rows) for number, rows in frames.items()}


def _boxes(rows: list[tuple[str, str, list[float]]]) -> LabelledBoxes:
    xyxy = np.array([corners for _, _, corners in rows], dtype=np.float64) - 1.0
    return LabelledBoxes(xyxy, tuple(row[0] for row in rows), tuple(row[1] for row in rows))


def _text(value: np.ndarray) -> str:
    return str(value.item())


def _corners(struct: np.ndarray) -> list[float]:
    return [float(struct[side].item()) for side in ("left", "top", "right", "bottom")]
