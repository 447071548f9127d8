"""Washington RGB-D Scenes v2 (Lai et al. 2014).

    imgs/scene_01/00000-color.png   imgs/scene_01/00000-depth.png
    pc/01.pose      rows `qw qx qy qz tx ty tz`, camera to world, row n for image n
    pc/01.label     number of points, then one class id a point of the scene's cloud

Depth is in units of 0.1 mm, registered to colour. The intrinsics that make frames agree were found by back-projection:
f = 525, c = (319.5, 239.5), not the often-quoted 570.3.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import InputError
from .frame import Intrinsics
from .images import DepthUnit, FrameFiles
from .poses import read_pose_rows
from .recorded import RecordedSequence
from .tables import read_text

LAYOUT = "00000-color.png and 00000-depth.png, or imgs/scene_NN/ with them"

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
DEPTH_UNIT = DepthUnit(per_metre=10000.0)
FPS = 30.0

# Ids of the label files. 1-5, 7, 8 and 10 agree with what scenes 02 and 03 show; 6 and 9 follow the same alphabet.
CLASSES = {
    1: "bowl",
    2: "cap",
    3: "cereal_box",
    4: "coffee_mug",
    5: "coffee_table",
    6: "office_chair",
    7: "soda_can",
    8: "sofa",
    9: "table",
    10: "background",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class RgbdScenesV2(RecordedSequence):
    """A scene, with the labels of its point cloud.

    Attributes:
        label_file: the scene's label file, whether it exists or not.
    """

    label_file: Path

    def labels(self) -> np.ndarray:
        """(P,) class id of each point of the scene's cloud, in its order; `CLASSES` names them.

        Raises:
            InputError: the label file is missing, or its first line is not the number of ids that follow.
        """
        form = "the number of ids, then the ids"
        text = read_text(self.label_file, form, "download the point clouds (pc/) of the dataset")
        try:
            ids = np.array(text.split(), dtype=np.int64)
        except ValueError as error:
            raise InputError(self.label_file, form, str(error), "download the file again") from None
        if len(ids) == 0 or ids[0] != len(ids) - 1:
            found = f"{ids[0]}, and {len(ids) - 1} ids" if len(ids) else "no number"
            raise InputError(self.label_file, form, found, "download the file again")
        return ids[1:]


def find_rgbd_scenes_v2(path: Path) -> list[Path]:
    """The scenes' image folders: `path` itself, else those in `path/imgs` or `path`."""
    return [
        folder
        for folder in (path, *sorted(path.glob("imgs/scene_*")), *sorted(path.glob("scene_*")))
        if next(folder.glob("[0-9]*-color.png"), None)
    ]


def open_rgbd_scenes_v2(path: Path) -> RgbdScenesV2:
    """Opens one scene's image folder. Frames are the numbers of which both images exist; stamps are numbers at 30 Hz.

    Poses are read where `../../pc/NN.pose` exists; a frame beyond its last row is broken.

    Raises:
        InputError: there are no frames, or the pose file is wrong.
    """
    colors = {int(p.name.split("-")[0]): p for p in path.glob("[0-9]*-color.png")}
    depths = {int(p.name.split("-")[0]): p for p in path.glob("[0-9]*-depth.png")}
    numbers = sorted(colors.keys() & depths.keys())
    if not numbers:
        found = f"{len(colors)} colour and {len(depths)} depth images, and no pair"
        raise InputError(path, LAYOUT, found, "give a scene's image folder")
    folder = path.resolve()
    scene = re.sub(r"\D", "", folder.name)
    clouds = folder.parent.parent / "pc"
    poses, problems = _read_poses(clouds / f"{scene}.pose", numbers)
    return RgbdScenesV2(
        path=path,
        name=folder.name,
        files=tuple(FrameFiles(colors[n].name.split("-")[0], colors[n], depths[n]) for n in numbers),
        intrinsics=CAMERA,
        depth_unit=DEPTH_UNIT,
        stamps=np.array(numbers) / FPS,
        poses=poses,
        pose_problems=problems,
        label_file=clouds / f"{scene}.label",
    )


def _read_poses(path: Path, numbers: list[int]) -> tuple[np.ndarray | None, dict[int, str]]:
    if not path.is_file():
        return None, {}
    rows = read_pose_rows(path)
    poses = np.full((len(numbers), 4, 4), np.nan)
    known = np.array(numbers) < len(rows)
    poses[known] = rows[np.array(numbers)[known]]
    problems = {
        int(i): f"{path.name} has no pose for image {numbers[i]}" for i in np.flatnonzero(np.isnan(poses[:, 0, 0]))
    }
    return poses, problems
