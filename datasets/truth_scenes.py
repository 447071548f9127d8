"""Truth of the Washington RGB-D Scenes: boxes in images (version 1), labelled clouds and poses (version 2).

Version 2's labels and poses are of use without the images, version 1's boxes too.

    pc/01.pose   pc/01.label   pc/01.ply      version 2: give one of them, or the scene's images
    desk/desk_1.mat                           version 1, as distributed: give it, or the video's images beside it
    boxes.tsv                                 version 1, all videos in a table (see `box_truth`): boxes.tsv#desk_1
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from . import rgbd_scenes_v1, rgbd_scenes_v2
from .box_truth import LabelledBoxes, read_boxes_mat, read_boxes_tsv
from .errors import InputError
from .ground_truth import GroundTruth
from .poses import read_pose_rows
from .rgbd_scenes_v1 import RgbdScenesV1
from .rgbd_scenes_v2 import RgbdScenesV2
from .tables import read_text
from .truth import NO_OBJECT, FrameTruth, PointTruth, TrueObject

V1_CLASSES = ("bowl", "cap", "cereal_box", "coffee_mug", "flashlight", "soda_can")  # annotated in every video
BACKGROUND = 10  # of version 2's labels
UNKNOWN = np.full(3, np.nan)


def truth_of_v1(sequence: RgbdScenesV1) -> GroundTruth:
    """Boxes of a video with its images, from the `.mat` beside its folder; raises `InputError` as `boxes` does."""
    boxes = dict(enumerate(sequence.boxes()))
    return _truth_of_boxes(sequence.name, boxes, sequence.names, sequence.stamps, sequence)


def truth_of_v1_boxes(path: Path, video: str | None = None) -> GroundTruth:
    """Boxes of a video without its images.

    Args:
        path: the video's `.mat`, or a `.tsv` table.
        video: which one of the table; None where it holds one.

    Raises:
        InputError: the file is not as described in `box_truth`, or which video is meant does not become clear.
    """
    if path.suffix == ".mat":
        name, numbered = path.stem, read_boxes_mat(path)
    else:
        videos = read_boxes_tsv(path)
        if video is None and len(videos) == 1:
            video = next(iter(videos))
        if video not in videos:
            found = f"{video!r}, and {', '.join(videos)}" if video else ", ".join(videos) or "no row"
            raise InputError(path, "a table of one video, or the name of one in it", found, f"write {path.name}#VIDEO")
        name, numbered = video, videos[video]
    frames = np.arange(1, max(numbered, default=0) + 1)
    boxes = {k: numbered.get(int(number), LabelledBoxes.none()) for k, number in enumerate(frames)}
    return _truth_of_boxes(name, boxes, tuple(f"{name}_{n}" for n in frames), frames / rgbd_scenes_v1.FPS, None)


def truth_of_v2(sequence: RgbdScenesV2) -> GroundTruth:
    """Poses of a scene with its images, and its labelled cloud where label file and cloud are there.

    Raises:
        InputError: a file is damaged.
    """
    return _truth_of_scene(
        sequence.name, sequence.label_file, sequence.names, sequence.stamps, sequence.poses, sequence
    )


def truth_of_v2_files(path: Path) -> GroundTruth:
    """What the files `NN.pose`, `NN.label` and `NN.ply` of a scene tell, given one of them.

    Images in `../imgs/scene_NN` become its sequence.

    Raises:
        InputError: a file is damaged.
    """
    images = path.resolve().parent.parent / "imgs" / f"scene_{path.stem}"
    if rgbd_scenes_v2.find_rgbd_scenes_v2(images) == [images]:
        return truth_of_v2(rgbd_scenes_v2.open_rgbd_scenes_v2(images))
    pose_file = path.with_suffix(".pose")
    poses = read_pose_rows(pose_file) if pose_file.is_file() else None
    count = 0 if poses is None else len(poses)
    names, stamps = tuple(f"{k:05d}" for k in range(count)), np.arange(count) / rgbd_scenes_v2.FPS
    return _truth_of_scene(f"scene_{path.stem}", path.with_suffix(".label"), names, stamps, poses, None)


def _truth_of_boxes(
    name: str,
    boxes: Mapping[int, LabelledBoxes],
    names: tuple[str, ...],
    stamps: np.ndarray,
    sequence: RgbdScenesV1 | None,
) -> GroundTruth:
    """Objects are known by their boxes only; occlusion was not annotated, so all counts as visible."""
    labels = {
        instance: label
        for frame in boxes.values()
        for instance, label in zip(frame.instances, frame.classes, strict=True)
    }
    ids = {instance: k for k, instance in enumerate(sorted(labels))}
    return GroundTruth(
        name=name,
        classes=tuple(sorted({*V1_CLASSES, *labels.values()})),
        objects=tuple(TrueObject(k, labels[instance], UNKNOWN, UNKNOWN, 0.0) for instance, k in ids.items()),
        intrinsics=rgbd_scenes_v1.CAMERA if sequence is None else sequence.intrinsics,
        names=names,
        stamps=stamps,
        frame_truth=partial(_frame_truth, boxes, ids),
        sequence=sequence,
    )


def _frame_truth(boxes: Mapping[int, LabelledBoxes], ids: Mapping[str, int], index: int) -> FrameTruth | None:
    frame = boxes.get(index)
    if frame is None:
        return None
    object_id = np.array([ids[instance] for instance in frame.instances], dtype=np.int64)
    return FrameTruth(object_id, frame.xyxy.copy(), frame.xyxy.copy(), np.ones(len(frame)))


def _truth_of_scene(
    name: str,
    label_file: Path,
    names: tuple[str, ...],
    stamps: np.ndarray,
    poses: np.ndarray | None,
    sequence: RgbdScenesV2 | None,
) -> GroundTruth:
    """Points have classes but no instances, so there are no objects, and what is found is no false positive."""
    cloud_file = label_file.with_suffix(".ply")
    labels = _read_labels(label_file) if label_file.is_file() else None
    classes: dict[int, str] = {}
    if labels is not None:
        others = {int(label): f"class {label}" for label in np.unique(labels)}
        classes = {label: name for label, name in (others | rgbd_scenes_v2.CLASSES).items() if label != BACKGROUND}
    point_truth = None
    if labels is not None and cloud_file.is_file():
        point_truth = partial(_point_truth, cloud_file, labels, sorted(classes))
    return GroundTruth(
        name=name,
        classes=tuple(classes[label] for label in sorted(classes)),
        complete=False,
        intrinsics=rgbd_scenes_v2.CAMERA,
        names=names,
        stamps=stamps,
        poses=poses,
        point_truth=point_truth,
        sequence=sequence,
    )


def _read_labels(path: Path) -> np.ndarray:
    """(P,) int64 class id of each point."""
    form, remedy = "the number of ids, then the ids, none negative", "download the file again"
    try:
        ids = np.array(read_text(path, form, remedy).split(), dtype=np.int64)
    except (ValueError, OverflowError) as error:
        raise InputError(path, form, str(error), remedy) from None
    if len(ids) == 0 or ids[0] != len(ids) - 1 or ids.min() < 0:
        found = f"{ids[0]}, and {len(ids) - 1} ids from {ids[1:].min(initial=0)}" if len(ids) else "no number"
        raise InputError(path, form, found, remedy)
    return ids[1:]


def _point_truth(cloud_file: Path, labels: np.ndarray, classes: list[int]) -> PointTruth:
    """The cloud with its labels as indices into `classes`."""
    from plyfile import PlyData, PlyParseError

    form, remedy = "the scene's cloud in PLY, a point for each label", "download the file again"
    try:
        vertices = PlyData.read(str(cloud_file))["vertex"].data
        points = np.stack([vertices[axis] for axis in "xyz"], axis=1).astype(np.float32)
    except (OSError, KeyError, ValueError, IndexError, PlyParseError) as error:
        raise InputError(cloud_file, form, f"{type(error).__name__}: {error}", remedy) from None
    if len(points) != len(labels):
        raise InputError(cloud_file, form, f"{len(points)} points and {len(labels)} labels", remedy)
    place = np.minimum(np.searchsorted(classes, labels), len(classes) - 1)
    return PointTruth(points, np.where(np.array(classes)[place] == labels, place, NO_OBJECT), None)
