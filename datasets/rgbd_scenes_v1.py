"""Washington RGB-D Scenes v1 (Lai et al. 2011): eight videos with 2D boxes, no poses.

    desk/desk_1/desk_1_1.png   desk/desk_1/desk_1_1_depth.png      numbered from 1
    desk/desk_1.mat                                                boxes (see `box_truth`)

Depth is in millimetres. The dataset publishes no calibration: 570.3, the nominal focal length of the depth camera, is
often quoted, but in version 2, of the same kind of camera, frames agree with f = 525 only. Version 1 has no poses to
decide it by, so 525 is assumed here; give `intrinsics` where you know better.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from glob import escape
from pathlib import Path

import numpy as np

from .box_truth import LabelledBoxes, read_boxes_mat
from .errors import InputError
from .frame import Intrinsics
from .images import DepthUnit, FrameFiles
from .recorded import RecordedSequence

LAYOUT = "NAME/NAME_1.png and NAME/NAME_1_depth.png (NAME such as desk_1)"

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
DEPTH_UNIT = DepthUnit(per_metre=1000.0)
FPS = 30.0


@dataclass(frozen=True, eq=False, kw_only=True)
class RgbdScenesV1(RecordedSequence):
    """A video, with the numbers by which its box file calls the frames.

    Attributes:
        numbers: (N,) number of each frame, from 1.
        box_file: the video's `.mat`, whether it exists or not.
    """

    numbers: np.ndarray
    box_file: Path

    def boxes(self) -> list[LabelledBoxes]:
        """The annotated boxes of each of the N frames.

        Raises:
            InputError: the video's `.mat` is missing or is not as distributed.
        """
        by_number = read_boxes_mat(self.box_file)
        return [by_number.get(int(number), LabelledBoxes.none()) for number in self.numbers]


def find_rgbd_scenes_v1(path: Path) -> list[Path]:
    """The video folders: `path` itself, else its folders (a scene), else theirs (the whole dataset)."""
    for folders in ([path], sorted(path.glob("*/")), sorted(path.glob("*/*/"))):
        if videos := [folder for folder in folders if _is_video(folder)]:
            return videos
    return []


def open_rgbd_scenes_v1(path: Path, intrinsics: Intrinsics = CAMERA) -> RgbdScenesV1:
    """Opens one video folder. A frame counts where either of its images exists; stamps are numbers at 30 Hz.

    Args:
        path: the video's folder, such as `desk/desk_1`.
        intrinsics: of both images.

    Raises:
        InputError: there are no frames.
    """
    folder = path.resolve()
    pattern = re.compile(re.escape(folder.name) + r"_(\d+)(_depth)?\.png")
    matches = [match for entry in path.glob("*.png") if (match := pattern.fullmatch(entry.name))]
    numbers = sorted({int(match.group(1)) for match in matches})
    if not numbers:
        raise InputError(path, LAYOUT, "no such file", "give a video's folder")
    names = [f"{folder.name}_{number}" for number in numbers]
    return RgbdScenesV1(
        path=path,
        name=folder.name,
        files=tuple(FrameFiles(name, path / f"{name}.png", path / f"{name}_depth.png") for name in names),
        intrinsics=intrinsics,
        depth_unit=DEPTH_UNIT,
        stamps=np.array(numbers) / FPS,
        numbers=np.array(numbers),
        box_file=folder.with_suffix(".mat"),
    )


def _is_video(folder: Path) -> bool:
    return next(folder.glob(f"{escape(folder.resolve().name)}_*_depth.png"), None) is not None
