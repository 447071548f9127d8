"""Colour and depth images from files, with every reason why a frame may be unusable."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from .frame import BrokenFrame, FrameProblem, Intrinsics

# The depth image must match the colour image pixel by pixel: a rotation tag in one of them must not turn it.
_COLOR_FLAGS = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION


@dataclass(frozen=True, slots=True)
class FrameFiles:
    """The two image files of a frame; a file that is not there makes the frame broken, not the sequence.

    Attributes:
        name: what the dataset calls the frame.
        color: 8-bit colour image.
        depth: 16-bit or float depth image.
    """

    name: str
    color: Path
    depth: Path


@dataclass(frozen=True, slots=True)
class DepthUnit:
    """What the numbers in a depth image mean.

    Attributes:
        per_metre: value of a depth of one metre.
        no_reading: value, besides 0, that stands for "no reading"; None where 0 is the only one.
    """

    per_metre: float
    no_reading: int | None = None


def read_frame_images(files: FrameFiles, unit: DepthUnit, intrinsics: Intrinsics) -> tuple[np.ndarray, np.ndarray]:
    """(H, W, 3) uint8 RGB and (H, W) float32 metres with 0 for "no reading".

    Raises:
        BrokenFrame: a file is missing or cannot be decoded (`UNREADABLE`), a size is not that of the intrinsics
            (`SIZE_MISMATCH`), or no pixel has a depth (`NO_DEPTH`).
    """
    color = read_color(files.name, files.color, intrinsics)
    raw = _decode(files.name, files.depth, cv2.IMREAD_UNCHANGED)
    _check_size(files.name, files.depth, raw, intrinsics)
    depth = _metres(files, raw, unit)
    if not depth.any():
        raise BrokenFrame(files.name, FrameProblem.NO_DEPTH, f"no pixel of {files.depth.name} has a depth")
    return color, depth


def read_color(name: str, path: Path, intrinsics: Intrinsics) -> np.ndarray:
    """(H, W, 3) uint8 RGB of the frame that is called `name`.

    Raises:
        BrokenFrame: the file is missing or cannot be decoded (`UNREADABLE`), or its size is not that of the intrinsics
            (`SIZE_MISMATCH`).
    """
    color = _decode(name, path, _COLOR_FLAGS)
    _check_size(name, path, color, intrinsics)
    return color


def first_image_size(paths: Iterable[Path]) -> tuple[int, int] | None:
    """(width, height) of the first colour image that can be read; None where none can."""
    for path in paths:
        try:
            image = _decode(path.name, path, _COLOR_FLAGS)
        except BrokenFrame:
            continue
        return image.shape[1], image.shape[0]
    return None


def _decode(name: str, path: Path, flags: int) -> np.ndarray:
    # Bytes first: a missing file is told apart from a damaged one, and OpenCV prints no warning of its own.
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise BrokenFrame(name, FrameProblem.UNREADABLE, f"{path.name} is missing") from None
    except OSError as error:
        raise BrokenFrame(name, FrameProblem.UNREADABLE, f"{path.name}: {error.strerror}") from None
    if not data:
        raise BrokenFrame(name, FrameProblem.UNREADABLE, f"{path.name} is empty")
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    except cv2.error:
        image = None
    if image is None:
        raise BrokenFrame(name, FrameProblem.UNREADABLE, f"{path.name} cannot be decoded")
    return image


def _check_size(name: str, path: Path, image: np.ndarray, intrinsics: Intrinsics) -> None:
    height, width = image.shape[:2]
    if (width, height) != (intrinsics.width, intrinsics.height):
        detail = f"{path.name} is {width} x {height}, the camera {intrinsics.width} x {intrinsics.height}"
        raise BrokenFrame(name, FrameProblem.SIZE_MISMATCH, detail)


def _metres(files: FrameFiles, raw: np.ndarray, unit: DepthUnit) -> np.ndarray:
    if raw.ndim != 2 or raw.dtype not in (np.uint16, np.float32):
        channels = 1 if raw.ndim == 2 else raw.shape[2]
        detail = f"{files.depth.name} has {channels} x {raw.dtype}, depth needs one channel of uint16 or float32"
        raise BrokenFrame(files.name, FrameProblem.UNREADABLE, detail)
    if unit.no_reading is not None:
        raw[raw == unit.no_reading] = 0
    depth = np.multiply(raw, np.float32(1.0 / unit.per_metre), dtype=np.float32)
    if raw.dtype == np.float32:
        depth[~(np.isfinite(depth) & (depth > 0))] = 0.0
    return depth
