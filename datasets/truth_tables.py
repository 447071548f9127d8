"""The large parts of written truth: rows of every frame, instance images, the labelled cloud (see `truth_files`).

`frames.npz` holds `stamps` (N,) seconds, and for R sightings of objects, ordered by frame: `frame` (R,) its index,
and `object_id`, `xyxy`, `xyxy_visible`, `visibility`, `part_visibility`, rows of what `FrameTruth` describes.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from .errors import InputError, UserError
from .truth import NO_OBJECT, PARTS, FrameTruth, PointTruth
from .truth_files import REMEDY, write_whole

MAX_ID = 65534  # of a thing in a 16-bit instance image
_ROWS = {
    "frame": ((), "i"),
    "object_id": ((), "i"),
    "xyxy": ((4,), "f"),
    "xyxy_visible": ((4,), "f"),
    "visibility": ((), "f"),
    "part_visibility": ((len(PARTS),), "f"),
}
_FRAMES_FORM = f"arrays stamps, {', '.join(_ROWS)}"
_CLOUD_FORM = "a point cloud with x, y, z, class_id"


@dataclass(frozen=True, slots=True, eq=False)
class FrameTable:
    """All of `frames.npz`.

    Attributes:
        stamps: (N,) seconds.
        first: (N + 1,) row at which each frame begins; its rows end where the next one's begin.
        rows: the R rows, as one `FrameTruth`.
    """

    stamps: np.ndarray
    first: np.ndarray
    rows: FrameTruth

    def frame(self, index: int) -> FrameTruth:
        """What can be seen in the frame with this index, 0 to N - 1."""
        mine, rows = slice(self.first[index], self.first[index + 1]), self.rows
        return FrameTruth(
            rows.object_id[mine].copy(),
            rows.xyxy[mine].copy(),
            rows.xyxy_visible[mine].copy(),
            rows.visibility[mine].copy(),
            rows.part_visibility[mine].copy(),
        )


def write_frames(path: Path, stamps: np.ndarray, frames: Sequence[FrameTruth]) -> None:
    """Writes `frames.npz` of N frames with (N,) stamps in seconds; raises `UserError` where that fails."""
    columns = {
        "frame": [np.full(len(frame.object_id), k) for k, frame in enumerate(frames)],
        **{name: [np.asarray(getattr(frame, name)) for frame in frames] for name in _ROWS if name != "frame"},
    }
    arrays: dict[str, np.ndarray] = {"stamps": np.asarray(stamps, dtype=np.float64)}
    for name, (shape, kind) in _ROWS.items():
        empty = np.empty((0, *shape), dtype=np.int64 if kind == "i" else np.float64)
        arrays[name] = np.concatenate([empty, *(c.reshape(-1, *shape) for c in columns[name])]).astype(empty.dtype)
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)  # pyright: ignore[reportArgumentType]
    write_whole(path, content.getvalue())


def read_frames(path: Path, frames: int, ids: set[int]) -> FrameTable:
    """Reads `frames.npz` of a sequence of `frames` frames, whose things have these ids.

    Raises:
        InputError: the file is missing or damaged, or is of another sequence.
    """
    arrays = _load(path)
    stamps, frame, object_id = arrays["stamps"], arrays["frame"], arrays["object_id"]
    if stamps.shape != (frames,):
        found = f"{len(stamps)} stamps" if stamps.ndim else "no stamps"
        raise InputError(path, f"a stamp for each of truth.json's {frames} frames", found, REMEDY)
    if not np.isfinite(stamps).all() or (np.diff(stamps) <= 0).any():
        raise InputError(path, "rising stamps", "others", REMEDY)
    if len(frame) and (frame[0] < 0 or frame[-1] >= frames or (np.diff(frame) < 0).any()):
        found = f"{frame.min()} to {frame.max()}"
        raise InputError(path, f"rising frame numbers from 0 to {frames - 1}", found, REMEDY)
    if strange := sorted(set(object_id.tolist()) - ids):
        raise InputError(path, "ids of truth.json's objects", f"id {strange[0]}", REMEDY)
    seen = np.concatenate([arrays["visibility"][:, None], arrays["part_visibility"]], axis=1)
    if not (np.isfinite(arrays["xyxy"]).all() and ((seen >= 0.0) & (seen <= 1.0)).all()):
        raise InputError(path, "finite boxes and visibilities from 0 to 1", "others", REMEDY)
    rows = FrameTruth(*(arrays[name] for name in _ROWS if name != "frame"))
    return FrameTable(stamps, np.searchsorted(frame, np.arange(frames + 1)), rows)


def encode_instances(instances: np.ndarray) -> bytes:
    """(H, W) ids, `NO_OBJECT` where there is none, as a PNG of id + 1.

    Raises:
        UserError: an id is too large for the format.
    """
    if instances.max(initial=NO_OBJECT) > MAX_ID:
        raise UserError(f"instance images hold ids up to {MAX_ID}, found {instances.max()}; number the things anew")
    return cv2.imencode(".png", (instances + 1).astype(np.uint16))[1].tobytes()


def read_instances(path: Path, shape: tuple[int, int], ids: set[int]) -> np.ndarray:
    """(H, W) int32 ids, `NO_OBJECT` where there is none.

    Raises:
        InputError: the image is missing, damaged, of another shape, or shows an id that is not among `ids`.
    """
    form = f"a 16-bit PNG of {shape[1]} x {shape[0]} pixels"
    try:
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise InputError(path, form, _why(error), REMEDY) from None
    try:
        image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
    except cv2.error:
        image = None
    if image is None:
        raise InputError(path, form, "an image that cannot be decoded" if len(data) else "an empty file", REMEDY)
    if image.shape != shape or image.dtype != np.uint16:
        size = " x ".join(str(n) for n in image.shape[1::-1] + image.shape[2:])
        raise InputError(path, form, f"{size} of {image.dtype}", REMEDY)
    instances = image.astype(np.int32) - 1
    present = np.flatnonzero(np.bincount(image.ravel())[1:])
    if strange := [int(k) for k in present if int(k) not in ids]:
        raise InputError(path, "ids of truth.json's objects and clutter", f"id {strange[0]}", REMEDY)
    return instances


def write_cloud(path: Path, cloud: PointTruth) -> None:
    """Writes the labelled cloud as binary PLY, metres; raises `UserError` where that fails."""
    from plyfile import PlyData, PlyElement

    columns = {axis: cloud.points[:, k].astype("<f4") for k, axis in enumerate("xyz")}
    columns["class_id"] = cloud.class_id.astype("<i4")
    if cloud.object_id is not None:
        columns["object_id"] = cloud.object_id.astype("<i4")
    vertices = np.empty(len(cloud.points), dtype=[(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        vertices[name] = column
    content = io.BytesIO()
    PlyData([PlyElement.describe(vertices, "vertex")], byte_order="<").write(content)
    write_whole(path, content.getvalue())


def read_cloud(path: Path, classes: int, ids: set[int]) -> PointTruth:
    """Reads the labelled cloud.

    Raises:
        InputError: the file is missing or damaged, or names a class from `classes` on or an id not among `ids`.
    """
    from plyfile import PlyData, PlyParseError

    try:
        vertices = PlyData.read(str(path))["vertex"].data
        points = np.stack([vertices[axis] for axis in "xyz"], axis=1).astype(np.float32)
        class_id = vertices["class_id"].astype(np.int64)
        object_id = vertices["object_id"].astype(np.int64) if "object_id" in (vertices.dtype.names or ()) else None
    except OSError as error:
        raise InputError(path, _CLOUD_FORM, _why(error), REMEDY) from None
    except (KeyError, ValueError, IndexError, PlyParseError, UnicodeDecodeError) as error:
        raise InputError(path, _CLOUD_FORM, f"{type(error).__name__}: {error}", REMEDY) from None
    if not np.isfinite(points).all():
        raise InputError(path, "finite points", "others", REMEDY)
    if len(class_id) and not NO_OBJECT <= class_id.min() <= class_id.max() < classes:
        found = f"{class_id.min()} to {class_id.max()}"
        raise InputError(path, f"class_id from {NO_OBJECT} to {classes - 1}", found, REMEDY)
    if object_id is not None and (strange := set(np.unique(object_id).tolist()) - ids - {NO_OBJECT}):
        raise InputError(path, "ids of truth.json's objects and clutter", f"id {min(strange)}", REMEDY)
    return PointTruth(points, class_id, object_id)


def _load(path: Path) -> dict[str, np.ndarray]:
    """The arrays of `frames.npz`, each of its kind and shape."""
    try:
        content = np.load(path, allow_pickle=False)
        if not isinstance(content, np.lib.npyio.NpzFile):
            raise InputError(path, _FRAMES_FORM, "one array", REMEDY)
        with content:
            if missing := [name for name in ("stamps", *_ROWS) if name not in content.files]:
                raise InputError(path, _FRAMES_FORM, f"no {', '.join(missing)}", REMEDY)
            arrays = {name: content[name] for name in ("stamps", *_ROWS)}
    except OSError as error:
        raise InputError(path, _FRAMES_FORM, _why(error), REMEDY) from None
    except (ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error, NotImplementedError) as error:
        raise InputError(path, _FRAMES_FORM, f"a damaged file ({error})", REMEDY) from None
    count = len(arrays["frame"]) if arrays["frame"].ndim else -1
    for name, (shape, kind) in (("stamps", (arrays["stamps"].shape, "f")), *_ROWS.items()):
        expected = shape if name == "stamps" else (count, *shape)
        if arrays[name].shape != expected or arrays[name].dtype.kind != kind:
            found = f"{name} of shape {arrays[name].shape}, {arrays[name].dtype}"
            raise InputError(path, f"{name} of shape {expected}", found, REMEDY)
    return arrays


def _why(error: OSError) -> str:
    return "no such file" if isinstance(error, FileNotFoundError) else (error.strerror or str(error)).lower()
