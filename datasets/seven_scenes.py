"""7-Scenes (Shotton et al. 2013), as distributed and in the form that TSDF fusion tools use.

    frame-000000.color.png   frame-000000.depth.png   frame-000000.pose.txt      (or .color.jpg)
    camera-intrinsics.txt | camera-intrinsics.color.txt      optional, 3x3
    gravity-direction.txt                                    optional, down in the world of the poses, if any

Depth is in millimetres; 0 and 65535 mean "no reading". Poses are 4x4, depth camera to world.

Colour and depth are those of the Kinect's two cameras, not registered: the same point is up to 30 pixels apart. Unless
another camera matrix than the depth camera's is given, the loader registers depth to colour, so that detections on the
colour images meet the right depth; frames, and their poses, are then the colour camera's.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .camera_files import read_camera_matrix, read_gravity
from .errors import InputError
from .frame import Intrinsics
from .images import DepthUnit, FrameFiles, first_image_size
from .poses import nearest_rotations
from .recorded import RecordedSequence
from .registration import DepthRegistration

LAYOUT = "frame-000000.color.png or .jpg, frame-000000.depth.png, frame-000000.pose.txt"

# The dataset has no calibration; these are the values its authors' KinectFusion ran with.
KINECT = Intrinsics(640, 480, 585.0, 585.0, 320.0, 240.0)
# Measured on 30 frames of redkitchen by aligning depth edges with image edges (mean distance 5.8 -> 3.5 px): focal
# length to 0.3 px, principal point to 0.5 px, offset to 1.5 mm between halves of the frames.
REGISTRATION = DepthRegistration(
    depth=KINECT, color=Intrinsics(640, 480, 526.7, 526.7, 322.1, 236.6), offset=(-0.0293, 0.0046, 0.0)
)
DEPTH_UNIT = DepthUnit(per_metre=1000.0, no_reading=65535)
FPS = 30.0

_FILE = re.compile(r"frame-(\d+)\.(color\.png|color\.jpg|depth\.png|pose\.txt)")


def find_seven_scenes(path: Path) -> list[Path]:
    """The sequence folders at `path` or, where it holds none itself, in its `seq-*` folders."""
    return [folder for folder in (path, *sorted(path.glob("seq-*"))) if any(folder.glob("frame-*.color.*"))]


def open_seven_scenes(path: Path) -> RecordedSequence:
    """Opens one sequence folder.

    A frame counts where its colour or its depth image exists. Stamps are the frame numbers at 30 Hz.

    Raises:
        InputError: there are no frames, or a camera file is wrong.
    """
    found: dict[int, dict[str, str]] = {}
    for entry in path.glob("frame-*"):
        if match := _FILE.fullmatch(entry.name):
            number, kind = match.groups()
            found.setdefault(int(number), {})[kind.split(".")[0]] = entry.name
    numbers = sorted(n for n, kinds in found.items() if "color" in kinds or "depth" in kinds)
    if not numbers:
        raise InputError(path, LAYOUT, "no such file", "give the folder that holds the frames")
    files = tuple(_files(path, number, found[number]) for number in numbers)
    poses, problems = _read_poses(path, [found[n].get("pose") for n in numbers])
    intrinsics = _read_intrinsics(path, files)
    registration = REGISTRATION if intrinsics == KINECT else None
    if registration is not None:
        intrinsics = registration.color
        poses = None if poses is None else poses @ registration.T_depth_color
    return RecordedSequence(
        path=path,
        name=_name(path),
        files=files,
        intrinsics=intrinsics,
        depth_unit=DEPTH_UNIT,
        stamps=np.array(numbers) / FPS,
        poses=poses,
        gravity=None if poses is None else read_gravity(path / "gravity-direction.txt"),
        registration=registration,
        pose_problems=problems,
    )


def _files(path: Path, number: int, kinds: Mapping[str, str]) -> FrameFiles:
    name = f"frame-{number:06d}"
    return FrameFiles(
        name, path / kinds.get("color", f"{name}.color.png"), path / kinds.get("depth", f"{name}.depth.png")
    )


def _name(path: Path) -> str:
    folder = path.resolve()
    return f"{folder.parent.name}-{folder.name}" if folder.name.startswith("seq-") else folder.name


def _read_poses(path: Path, names: list[str | None]) -> tuple[np.ndarray | None, dict[int, str]]:
    """(N, 4, 4) poses with NaN where there is none, and why; None where no frame has a pose file."""
    if not any(names):
        return None, {}
    matrices, unreadable = np.full((len(names), 4, 4), np.nan), {}
    for i, name in enumerate(names):
        if name is None:
            unreadable[i] = "there is no pose file"
            continue
        try:
            matrices[i] = np.array((path / name).read_text().split(), dtype=np.float64).reshape(4, 4)
        except (OSError, ValueError):  # UnicodeDecodeError is a ValueError
            unreadable[i] = f"{name} is not a 4x4 matrix"
    poses, problems = nearest_rotations(matrices)
    return poses, problems | unreadable


def _read_intrinsics(path: Path, files: tuple[FrameFiles, ...]) -> Intrinsics:
    size = first_image_size(f.color for f in files)
    if size is None:
        raise InputError(path, "colour images", "none that can be read", "check that the files are complete")
    for name in ("camera-intrinsics.txt", "camera-intrinsics.color.txt"):
        if (path / name).is_file():
            return read_camera_matrix(path / name, *size)
    if size != (KINECT.width, KINECT.height):
        found = f"none, and images of {size[0]} x {size[1]} pixels, so they are not the Kinect's 640 x 480"
        raise InputError(path / "camera-intrinsics.txt", "a 3x3 camera matrix", found, "write the camera's matrix")
    return KINECT
