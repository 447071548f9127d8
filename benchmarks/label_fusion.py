"""A folder of robot-posed views of a shelf with a label image for each, as depth fusion tools distribute them.

    camera-intrinsics.color.txt    3x3
    frame-000000.color.png  frame-000000.depth.png  frame-000000.segm.png or .mask.png
    frame-000000.pose.txt          4x4 camera-to-world, optional

Depth is that of a reading rotated left by three bits, in 0.1 mm: metres = (value rotated right by 3) / 10000.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from thingmap.datasets.camera_files import read_camera_matrix
from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import Frame

UNITS_PER_METRE = 10000.0


@dataclass(frozen=True, slots=True, eq=False)
class LabelledView:
    """A frame and its (H, W) int32 thing of each pixel, numbered from 0 by label; -1 where the label is the lowest."""

    frame: Frame
    instances: np.ndarray


def read_label_fusion(folder: Path) -> list[LabelledView]:
    """All views of a folder.

    Raises:
        InputError: for a folder without frames, or a frame with a file that is missing or broken.
    """
    names = sorted(path.name.removesuffix(".color.png") for path in folder.glob("frame-*.color.png"))
    if not names:
        raise InputError(folder, "frame-000000.color.png and so on", "no such file", "give the folder of the views")
    labels = "segm" if (folder / f"{names[0]}.segm.png").is_file() else "mask"
    return [_view(folder, index, name, labels) for index, name in enumerate(names)]


def _view(folder: Path, index: int, name: str, labels: str) -> LabelledView:
    color, depth, label = (_image(folder / f"{name}.{kind}.png") for kind in ("color", "depth", labels))
    raw = depth.astype(np.uint32)
    metres = (((raw << 13) | (raw >> 3)) & 0xFFFF).astype(np.float32) / UNITS_PER_METRE
    height, width = depth.shape
    camera = read_camera_matrix(folder / "camera-intrinsics.color.txt", width, height)
    frame = Frame(index, name, float(index), np.ascontiguousarray(color[..., ::-1]), metres, camera)
    pose = folder / f"{name}.pose.txt"
    if pose.is_file():
        frame = replace(frame, T_world_camera=_pose(pose))
    _, number = np.unique(label, return_inverse=True)
    return LabelledView(frame, number.reshape(label.shape).astype(np.int32) - 1)


def _pose(path: Path) -> np.ndarray:
    try:
        T = np.loadtxt(path, dtype=np.float64)
    except ValueError as error:
        raise InputError(path, "a 4x4 matrix", str(error), "check that the file is complete") from None
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise InputError(path, "a 4x4 matrix", f"shape {T.shape}", "check that the file is complete")
    return T


def _image(path: Path) -> np.ndarray:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise InputError(path, "an image", "none that can be read", "check that the file is complete")
    return image
