"""A rendered sequence as files: a plain folder (see `datasets.folder`) with its truth (see `datasets.truth_files`).

Colour is JPEG of quality 95 without subsampled colours: its error (2.4 grey levels, root mean square) stays below the
noise of the rendered camera (2.6), at a third of the size that PNG needs, which has to keep all of that noise.
Depth is PNG with 5000 units a metre: steps of 0.2 mm, while the finest disparity step of the sensor, at its nearest,
is 0.5 mm; what lies beyond 13.1 m does not fit and becomes "no reading".

`truth.json` is written first, naming all frames, and again at the end, naming those that were rendered: a writing
that was killed is told by the frames that are missing, and can be overwritten.
"""

from __future__ import annotations

import json
import os
from collections import deque
from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from ...errors import UserError
from ...frame import Intrinsics
from ...sequence import Sequence
from ...truth import FrameTruth, HasClutter, HasInstances, HasPointTruth, HasTruth
from ...truth_files import FOLDER, TruthPaths, TruthRecord, write_record, write_whole
from ...truth_tables import encode_instances, write_cloud, write_frames
from .written_config import plain_config
from .written_folder import CAMERA_FILE, POSES_FILE, image_files, prepare_folder, remove_frames

JPEG = (cv2.IMWRITE_JPEG_QUALITY, 95, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)
DEPTH_SCALE = 5000.0  # units per metre
DEPTH_LIMIT = 65535
POSE_HEADER = "# stamp tx ty tz qx qy qz qw: T_world_camera in seconds and metres, a row for each frame"
UP = np.array([0.0, 0.0, 1.0])  # of all rendered worlds
DEFAULT_FPS = 30.0  # of a sequence of one frame
MAX_WORKERS = 4  # threads; each keeps some casts of 5 MB


class Rendered(Sequence, HasTruth, HasInstances, Protocol):
    """A sequence with exact truth that is made from its configuration alone, and may be read by several threads."""

    @property
    def config(self) -> Any:
        """`SyntheticConfig` or `TabletopConfig`."""
        ...


@dataclass(frozen=True, slots=True)
class Written:
    """What came of writing a sequence.

    Attributes:
        folder: that holds it.
        frames: written, the first ones of the sequence.
        complete: whether these are all.
        megabytes: of all files in the folder.
    """

    folder: Path
    frames: int
    complete: bool
    megabytes: float


def write_sequence(
    sequence: Rendered,
    folder: Path,
    on_frame: Callable[[int], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    overwrite: bool = False,
    workers: int | None = None,
) -> Written:
    """Renders a sequence into a folder, which is made with its parents where absent.

    Args:
        sequence: what to render.
        folder: empty, or with `overwrite` one that an earlier call wrote.
        on_frame: is told the number of frames done, after each.
        should_stop: asked after each frame; when it says yes, what is rendered becomes a shorter whole sequence.
        overwrite: replace an earlier sequence; other files stay.
        workers: threads that render; None for as many as the machine has cores.

    Raises:
        UserError: the folder holds something else, or cannot be written.
    """
    prepare_folder(folder, overwrite)
    paths, names = TruthPaths(folder / FOLDER), tuple(sequence.names)
    write_record(paths.record, _record(sequence))
    write_whole(folder / CAMERA_FILE, _camera_json(sequence).encode())
    rows: list[FrameTruth] = []
    with closing(_in_order(_FrameWriter(sequence, folder), len(names), workers)) as frames:
        for truth in frames:
            rows.append(truth)
            if on_frame is not None:
                on_frame(len(rows))
            if should_stop():
                break
    remove_frames(folder, list(enumerate(names))[len(rows) :])
    kept = _shortened(sequence, len(rows))
    write_frames(paths.frames, kept.stamps, rows)
    if isinstance(kept, HasPointTruth):
        write_cloud(paths.cloud, kept.point_truth())
    if kept.poses is not None:
        write_whole(folder / POSES_FILE, _pose_rows(kept.stamps, kept.poses).encode())
    write_record(paths.record, _record(kept))
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    return Written(folder, len(kept), len(kept) == len(names), size / 1e6)


@dataclass(frozen=True, slots=True)
class _FrameWriter:
    """Writes the three images of a frame and gives its truth."""

    sequence: Rendered
    folder: Path

    def __call__(self, index: int) -> FrameTruth:
        frame = self.sequence[index]
        images = (
            _encode_color(frame.color),
            _encode_depth(frame.depth),
            encode_instances(self.sequence.instances(index)),
        )
        for file, content in zip(image_files(self.folder, frame.name, index), images, strict=True):
            try:
                file.write_bytes(content)
            except OSError as error:
                remedy = "make room, and write again with --overwrite"
                raise UserError(f"{file}: cannot be written ({error.strerror or error}); {remedy}") from error
        return self.sequence.truth(index)


def _in_order(work: _FrameWriter, count: int, workers: int | None) -> Generator[FrameTruth]:
    """`work` of the frames from 0 to `count`; closing it waits for the few beyond the last one that are under way.

    Threads serve as well as processes would: kernels, ray casting and encoding all release the interpreter.
    """
    workers = workers or min(os.cpu_count() or 1, MAX_WORKERS)
    pool = ThreadPoolExecutor(workers, thread_name_prefix="render")
    under_way: deque[Future[FrameTruth]] = deque()
    try:
        for index in range(count):
            under_way.append(pool.submit(work, index))
            if len(under_way) > workers:
                yield under_way.popleft().result()
        while under_way:
            yield under_way.popleft().result()
    finally:
        pool.shutdown(cancel_futures=True)


def _encode_color(color: np.ndarray) -> bytes:
    return cv2.imencode(".jpg", color[:, :, ::-1], JPEG)[1].tobytes()


def _encode_depth(depth: np.ndarray) -> bytes:
    units = np.rint(depth * DEPTH_SCALE)
    units[units > DEPTH_LIMIT] = 0.0
    return cv2.imencode(".png", units.astype(np.uint16))[1].tobytes()


def _shortened(sequence: Rendered, frames: int) -> Rendered:
    """The sequence of the first so many frames: what a configuration of fewer frames renders."""
    if frames == len(sequence):
        return sequence
    return type(sequence)(replace(sequence.config, frames=frames))  # pyright: ignore[reportCallIssue]


def _record(sequence: Rendered) -> TruthRecord:
    return TruthRecord(
        source=sequence.name,
        up=UP,
        classes=sequence.classes,
        objects=sequence.objects,
        clutter=sequence.clutter if isinstance(sequence, HasClutter) else (),
        configuration=plain_config(sequence.config),
        names=tuple(sequence.names),
        has_cloud=isinstance(sequence, HasPointTruth),
    )


def _camera_json(sequence: Rendered) -> str:
    camera: Intrinsics = sequence.intrinsics
    values: dict[str, Any] = {key: getattr(camera, key) for key in ("width", "height", "fx", "fy", "cx", "cy")}
    values |= {"depth_scale": DEPTH_SCALE, "fps": DEFAULT_FPS}
    if len(sequence) > 1:
        values["fps"] = round(float((len(sequence) - 1) / (sequence.stamps[-1] - sequence.stamps[0])), 6)
    if sequence.gravity is not None:
        values["gravity"] = sequence.gravity.tolist()
    return json.dumps(values) + "\n"


def _pose_rows(stamps: np.ndarray, poses: np.ndarray) -> str:
    """TUM lines; twelve decimals, so that what is computed from the poses stays the same to all intents."""
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat(canonical=True)
    rows = np.column_stack([stamps, poses[:, :3, 3], quaternions])
    return "\n".join([POSE_HEADER, *(" ".join(f"{value:.12f}" for value in row) for row in rows)]) + "\n"
