"""Keyframes of a TUM RGB-D sequence with motion-capture poses, as distributed with cuboid SLAM.

benchun_gt/rgb.txt  benchun_gt/depth.txt    rows `number file`, files relative to data/; the numbers are no stamps
benchun_gt/truth_cam_poses.txt              rows `stamp tx ty tz qx qy qz qw`, row i for keyframe i
benchun_gt/TUM3.yaml                        ORB-SLAM settings with the intrinsics
data/raw_imgs/0000_rgb_raw.jpg  data/depth_imgs/0000_depth_raw.png
"""

from __future__ import annotations

from pathlib import Path

from .errors import InputError
from .images import DepthUnit, FrameFiles
from .poses import read_tum_pose_rows
from .recorded import RecordedSequence
from .tum import Z_UP, find_camera, read_image_list

LAYOUT = "benchun_gt/rgb.txt and benchun_gt/truth_cam_poses.txt with data/"


def find_tum_keyframes(path: Path) -> list[Path]:
    """`path`, or the folder above where `path` is one of its two parts, if it holds such keyframes."""
    above = [path.resolve().parent] if path.name in ("benchun_gt", "data") else []
    return [folder for folder in (path, *above) if (folder / "benchun_gt" / "truth_cam_poses.txt").is_file()]


def open_tum_keyframes(path: Path) -> RecordedSequence:
    """Opens the keyframes. Stamps are those of the pose rows; names are the four digits that start the file names.

    Raises:
        InputError: a file is not as above, or the lists differ in length.
    """
    lists = path / "benchun_gt"
    color_numbers, color = read_image_list(lists / "rgb.txt")
    depth_numbers, depth = read_image_list(lists / "depth.txt")
    stamps, poses = read_tum_pose_rows(lists / "truth_cam_poses.txt")
    if not (len(color) == len(depth) == len(poses)) or (color_numbers != depth_numbers).any():
        found = f"{len(color)} colour images, {len(depth)} depth images, {len(poses)} poses"
        raise InputError(lists, "as many images as poses, numbered alike", found, "check that the lists are complete")
    data = path / "data"
    files = tuple(FrameFiles(Path(c).name.split("_")[0], data / c, data / d) for c, d in zip(color, depth, strict=True))
    camera = find_camera(lists, files)
    return RecordedSequence(
        path=path,
        name=path.resolve().name,
        files=files,
        intrinsics=camera.intrinsics,
        depth_unit=DepthUnit(camera.depth_scale),
        stamps=stamps,
        poses=poses,
        gravity=Z_UP,
    )
