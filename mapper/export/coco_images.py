"""The images that a run has mapped, for telling what can be seen in them: read again, or drawn from the map's cloud."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...datasets.errors import UserError
from ...datasets.frame import BrokenFrame, Intrinsics
from ...datasets.sequence import Sequence
from ...datasets.stamps import nearest
from ...factors.visibility import TOLERANCE_M
from ..map.object_map import ObjectMap
from ..map.store import OutputFolder
from ..mapped_sequence import open_mapped_sequence
from ..queries.depth_image import draw_points, empty_depth
from ..queries.run_files import RunFiles

ROUNDING = 1e-5  # s; files of trajectories hold microseconds


@dataclass(frozen=True, slots=True, eq=False)
class MappedImage:
    """One mapped frame.

    Attributes:
        file_name: of its colour image, relative to the sequence's folder.
        stamp: seconds.
        T_world_camera: (4, 4), map frame, as the run says.
        depth: (H, W) float32 metres along z; 0 without reading.
        intrinsics: of the image.
        tolerance_m: by which depth must be shorter than the way to a thing to hide it. What is drawn from a cloud needs
            a point's width more: without, things hid behind their own points, and visibility was 0.09 off on the mean
            in the sample and 0.05 in a rendered kitchen; with it 0.06 and 0.04.
    """

    file_name: str
    stamp: float
    T_world_camera: np.ndarray
    depth: np.ndarray
    intrinsics: Intrinsics
    tolerance_m: float = TOLERANCE_M


def open_images(
    folder: OutputFolder, sequence: str | None, dataset: str | None, say: Callable[[str], None]
) -> Sequence | None:
    """The sequence; None where none is named and the run's own is gone, which `say` is told.

    Raises:
        UserError: the one that is named cannot be read, or it has no images.
    """
    try:
        frames = open_mapped_sequence(folder, sequence, dataset)
    except UserError as error:
        if sequence is not None:
            raise
        say(f"{error}; until then the map's cloud tells what is hidden, and stamps name the images")
        return None
    if frames.intrinsics.width == 0:
        raise UserError(f"{frames.name}: it has no images to annotate; export a map of a camera's sequence")
    return frames


def read_images(
    folder: OutputFolder, frames: Sequence, stamps: np.ndarray, poses: np.ndarray, say: Callable[[str], None]
) -> Iterator[MappedImage]:
    """The frames of a sequence that were mapped, at (N,) stamps and (N, 4, 4) poses.

    Those that cannot be read any more are left out, and `say` is told which.

    Raises:
        UserError: the sequence has not all of them.
    """
    order = np.argsort(frames.stamps, kind="stable")
    found = nearest(stamps, np.asarray(frames.stamps)[order], ROUNDING)
    if missing := int(np.sum(found < 0)):
        raise UserError(
            f"{folder.path}: {missing} of its {len(found)} mapped frames are not in {frames.name}, by their stamps; "
            "give the sequence that was mapped with --sequence"
        )
    for index, pose in zip(order[found].tolist(), poses, strict=True):
        try:
            frame = frames[index]
        except BrokenFrame as problem:
            say(f"left out: {problem}")
            continue
        yield MappedImage(_file_name(frames, index, frame.name), frame.stamp, pose, frame.depth, frame.intrinsics)


def _file_name(frames: Sequence, index: int, name: str) -> str:
    """The colour file, relative to the sequence's folder; of rendered frames, which have no file, NAME.png."""
    whole, position = frames, index
    while hasattr(whole, "sequence") and hasattr(whole, "indices"):  # a part of another sequence
        whole, position = whole.sequence, whole.indices[position]  # type: ignore[attr-defined]
    files, folder = getattr(whole, "files", None), getattr(whole, "path", None)
    color = getattr(files[position], "color", None) if isinstance(files, tuple | list) else None
    if not isinstance(color, Path) or not isinstance(folder, Path):
        return f"{name}.png"
    return (color.relative_to(folder) if color.is_relative_to(folder) else color).as_posix()


def drawn_images(
    folder: OutputFolder, object_map: ObjectMap, stamps: np.ndarray, poses: np.ndarray
) -> Iterator[MappedImage]:
    """The same frames as the map's cloud shows them to the camera that made it; they are named by their stamps.

    Raises:
        UserError: the map has no cloud or no camera.
    """
    camera = object_map.camera
    if camera is None or not folder.cloud_file.is_file():
        lacking = "camera" if camera is None else "cloud"
        raise UserError(
            f"{folder.path}: the map has no {lacking} that tells what can be seen; name its sequence with --sequence"
        )
    run = RunFiles(object_map)
    points, apart = run.cloud(), run.spacing
    for stamp, pose in zip(stamps.tolist(), poses, strict=True):
        depth = empty_depth(camera)
        draw_points(depth, points, apart, pose, camera)
        yield MappedImage(f"{stamp:.6f}.png", stamp, pose, depth, camera, TOLERANCE_M + apart)
