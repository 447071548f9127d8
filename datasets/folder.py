"""A plain folder: the form for your own recordings.

    color/NAME.png or .jpg      8-bit
    depth/NAME.png or .tiff     16-bit (or float), registered to colour; 0 (or NaN) means "no reading"
    intrinsics.json             {"width": 640, "height": 480, "fx": 525, "fy": 525, "cx": 319.5, "cy": 239.5,
                                 "depth_scale": 1000, "fps": 30, "gravity": [0, 0, -1]}; the last two are optional
    poses.txt                   optional, rows `stamp tx ty tz qx qy qz qw`, camera to world
    accelerometer.txt           optional, rows `stamp ax ay az`, camera axes (x right, y down, z forward), m/s^2
    truth/                      optional, what is known of the scene (see `truth_files`): `thingmap synth` writes it

NAME is the same for colour and depth; frames are in natural order (2 before 10). Where every NAME is a number with a
decimal point it is the frame's stamp in seconds, else frame i is at i / fps. `depth_scale` is the value of a depth of
one metre; `gravity` points down in the world of the poses, and needs them.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from .camera_files import CameraFile, read_camera_json
from .errors import InputError
from .folder_truth import with_truth
from .frame import BrokenFrame, FrameProblem
from .images import DepthUnit, FrameFiles, read_frame_images
from .poses import read_poses_at, read_tum_pose_rows
from .recorded import RecordedSequence, natural_key
from .stamps import read_specific_force
from .truth_files import FOLDER as TRUTH

LAYOUT = "color/, depth/ and intrinsics.json"

_COLOR_SUFFIXES = (".png", ".jpg", ".jpeg")
_DEPTH_SUFFIXES = (".png", ".tiff", ".tif")
_STAMP = re.compile(r"\d+\.\d+")
_REMEDIES = {
    FrameProblem.UNREADABLE: "save colour as 8-bit PNG or JPEG, and depth as 16-bit PNG of one channel",
    FrameProblem.SIZE_MISMATCH: "register depth to colour, and give the intrinsics of these images",
    FrameProblem.NO_DEPTH: "check how depth was saved: 0 means no reading",
}


def find_folder(path: Path) -> list[Path]:
    """`path` where it holds a folder `color`."""
    return [path] if (path / "color").is_dir() else []


def open_folder(path: Path) -> RecordedSequence:
    """Opens the folder. A frame counts where either of its images exists; with only one of them it is broken.

    Poses are matched by stamp (see `StampedPoses.at`; a frame without one is usable), or, where the names are not
    stamps, row i belongs to frame i. With `truth/` the sequence is a `FolderWithTruth`.

    Raises:
        InputError: a part is missing or is not as above; it says which and what to do.
    """
    color = _images(path / "color", _COLOR_SUFFIXES)
    depth = _images(path / "depth", _DEPTH_SUFFIXES)
    camera = read_camera_json(path / "intrinsics.json")
    names = color.keys() | depth.keys()
    stamped = all(_STAMP.fullmatch(name) for name in names)
    order = sorted(names, key=float) if stamped else sorted(names, key=natural_key)
    files = _pair(path, order, color, depth)
    _check_sample(path, camera, files)
    if stamped:
        stamps = np.array([float(name) for name in order])
        poses = read_poses_at(path / "poses.txt", stamps)
    else:
        stamps = np.arange(len(order)) / camera.fps
        poses = _read_pose_rows(path / "poses.txt", len(order))
    if camera.gravity is not None and poses is None:
        remedy = "add poses.txt, or remove gravity"
        raise InputError(path / "intrinsics.json", "gravity in the world of the poses", "no poses.txt", remedy)
    sequence = RecordedSequence(
        path=path,
        name=path.resolve().name,
        files=files,
        intrinsics=camera.intrinsics,
        depth_unit=DepthUnit(camera.depth_scale),
        stamps=stamps,
        poses=poses,
        gravity=camera.gravity,
        specific_force=read_specific_force(path / "accelerometer.txt", stamps),
        pose_problems={} if stamped or poses is None else _rows_without_pose(poses),
    )
    return with_truth(sequence, path / TRUTH) if (path / TRUTH).is_dir() else sequence


def _images(folder: Path, suffixes: tuple[str, ...]) -> dict[str, Path]:
    """Image files by stem."""
    kinds = ", ".join(f"*{suffix}" for suffix in suffixes)
    if not folder.is_dir():
        raise InputError(folder, f"a folder of images ({kinds})", "no such folder", f"the folder form is {LAYOUT}")
    files: dict[str, Path] = {}
    for file in sorted(folder.iterdir()):
        if file.suffix.lower() not in suffixes or file.name.startswith("."):
            continue
        if file.stem in files:
            found = f"{files[file.stem].name} and {file.name}"
            raise InputError(folder, "one image for each name", found, "remove one of the two")
        files[file.stem] = file
    if not files:
        raise InputError(folder, f"images ({kinds})", "none", "put the images there")
    return files


def _pair(path: Path, order: list[str], color: dict[str, Path], depth: dict[str, Path]) -> tuple[FrameFiles, ...]:
    if not color.keys() & depth.keys():
        names = f"color/{next(iter(color.values())).name} and depth/{next(iter(depth.values())).name}"
        raise InputError(path, "colour and depth images of equal names", names, "rename one of the two sets")
    return tuple(
        FrameFiles(name, color.get(name, path / f"color/{name}.png"), depth.get(name, path / f"depth/{name}.png"))
        for name in order
    )


def _check_sample(path: Path, camera: CameraFile, files: tuple[FrameFiles, ...]) -> None:
    """One bad frame is a broken frame; where the first, middle and last complete ones are bad alike, the input is."""
    complete = [f for f in files if f.color.is_file() and f.depth.is_file()]
    sample = [complete[i] for i in sorted({0, len(complete) // 2, len(complete) - 1})]
    broken: list[BrokenFrame] = []
    for frame in sample:
        try:
            read_frame_images(frame, DepthUnit(camera.depth_scale), camera.intrinsics)
        except BrokenFrame as reason:
            broken.append(reason)
    if len(broken) == len(sample) and len({reason.problem for reason in broken}) == 1:
        reason = broken[0]
        raise InputError(path, "images that fit intrinsics.json", reason.detail, _REMEDIES[reason.problem])


def _read_pose_rows(path: Path, frames: int) -> np.ndarray | None:
    if not path.is_file():
        return None
    _, poses = read_tum_pose_rows(path)
    if len(poses) != frames:
        remedy = "give a row for each frame (nan for an unknown pose), or name the images by their stamps in seconds"
        raise InputError(path, f"{frames} rows, one a frame", f"{len(poses)} rows", remedy)
    return poses


def _rows_without_pose(poses: np.ndarray) -> dict[int, str]:
    return {int(i): f"row {i + 1} of poses.txt has no pose" for i in np.flatnonzero(np.isnan(poses[:, 0, 0]))}
