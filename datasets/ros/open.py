"""A bag becomes a sequence.

    NAME.bag                     ROS 1
    FOLDER/metadata.yaml         ROS 2, with its .db3 or .mcap files
    NAME.mcap, NAME.db3          ROS 2, a file alone

It needs colour images, depth images aligned to colour, and the calibration of the colour camera (`CameraInfo`). The
topics are told after the path, `bag.mcap?color=/camera/color/image_raw&depth=...&info=...`, or found (see `topics`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..frame import BrokenFrame, FrameProblem
from ..poses import MAX_STAMP_DIFFERENCE
from ..stamps import associate
from .bag import METADATA, METADATA_KEY, SUFFIXES, BadMessage, Bag, MessageIndex
from .camera import BagCamera, read_camera
from .motion import read_force, read_poses
from .sequence import BagSequence, Unpaired
from .topics import ChosenTopics, choose_topics, is_rectified

LAYOUT = "NAME.bag, NAME.mcap, NAME.db3, or metadata.yaml"
OPTIONS = ("color", "depth", "info", "poses", "imu")

_REMEDIES = {
    FrameProblem.UNREADABLE: "name topics with encodings that are read (see the documentation of bags)",
    FrameProblem.SIZE_MISMATCH: "name depth that is aligned to colour, and the calibration of these images",
    FrameProblem.NO_DEPTH: "name another topic of depth",
}


def find_bags(path: Path) -> list[Path]:
    """`path` where it is a bag, else the bags right in it."""
    if path.is_file():
        return [path] if path.suffix.lower() in SUFFIXES else []
    if (path / METADATA).is_file() and METADATA_KEY in (path / METADATA).read_bytes():
        return [path]
    return sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES and file.is_file())


def open_bag(
    path: Path,
    color: str | None = None,
    depth: str | None = None,
    info: str | None = None,
    poses: str | None = None,
    imu: str | None = None,
) -> BagSequence:
    """Opens a bag; one pass over it notes where the images are.

    Colour and depth are paired one to one by the stamps of their headers, the closest first, at most 0.02 s apart; the
    others are counted in `unpaired`. The stamp of a frame is that of its colour image. Lens distortion that moves a
    pixel by more than `camera.MATTERS` is removed from both images.

    Args:
        path: file or folder.
        color: topic of `sensor_msgs/Image` or `CompressedImage`; None to choose.
        depth: topic of depth images aligned to those; None to choose.
        info: topic of `sensor_msgs/CameraInfo` of the colour camera; None to choose.
        poses: topic of given poses of the camera (see `motion.read_poses`); None for none.
        imu: topic of an accelerometer (see `motion.read_force`); None to choose, "" for none.

    Raises:
        UserError: the library `rosbags` is not installed.
        InputError: the bag cannot be read, there is not exactly one choice of topics, or they do not fit together.
    """
    bag = Bag(path)
    topics = choose_topics(bag, color, depth, info)
    index = bag.index((topics.color.topic.name, topics.depth.topic.name))
    colors, depths = index[topics.color.topic.name], index[topics.depth.topic.name]
    pairs = associate(colors.seconds, depths.seconds, MAX_STAMP_DIFFERENCE)
    if len(pairs) == 0:
        found = f"none among {topics.color} and {topics.depth}"
        expected = f"stamps of colour and depth within {MAX_STAMP_DIFFERENCE} s"
        raise InputError(path, expected, found, "name topics of one camera, recorded at the same time")
    stamps = colors.seconds[pairs[:, 0]]
    sequence = BagSequence(
        bag=bag,
        topics=topics,
        name=path.resolve().stem,
        camera=_camera(bag, topics),
        color=_rows(colors, pairs[:, 0]),
        depth=_rows(depths, pairs[:, 1]),
        unpaired=Unpaired(len(colors.stamps) - len(pairs), len(depths.stamps) - len(pairs)),
        poses=None if poses is None else read_poses(bag, poses, topics.color.frame_id, stamps),
        specific_force=read_force(bag, imu, topics.color.frame_id, stamps),
    )
    _check_sample(sequence)
    return sequence


def _camera(bag: Bag, topics: ChosenTopics) -> BagCamera:
    try:
        message = bag.first(topics.info)
    except BadMessage as error:
        raise InputError(bag.path, f"a calibration in {topics.info}", str(error), "name another info topic") from None
    return read_camera(bag.path, topics.info, message, is_rectified(topics.color))


def _rows(index: MessageIndex, chosen: np.ndarray) -> np.ndarray:
    return np.stack([index.stamps[chosen], index.logged[chosen]], axis=1)


def _check_sample(sequence: BagSequence) -> None:
    """One bad frame is a broken frame; where the first, middle and last are bad alike, the topics do not fit."""
    sample = sorted({0, len(sequence) // 2, len(sequence) - 1})
    broken: list[BrokenFrame] = []
    for i in sample:
        try:
            sequence[i]
        except BrokenFrame as reason:
            broken.append(reason)
    if len(broken) == len(sample) and len({reason.problem for reason in broken}) == 1:
        reason = broken[0]
        raise InputError(sequence.path, "colour and depth images that fit", reason.detail, _REMEDIES[reason.problem])
