"""Images in ROS messages: every encoding that colour and depth come in.

| message | colour | depth |
|---|---|---|
| `Image` | rgb8, bgr8, rgba8, bgra8, mono8, 8UC1, 8UC3, yuv422, yuv422_yuy2, bayer_*8 | 16UC1, mono16 (mm), 32FC1 (m) |
| `CompressedImage` | JPEG, PNG | PNG of 16UC1 (mm); compressedDepth PNG of 16UC1 (mm) or 32FC1 (inverse depth) |

Depth in millimetres or metres is REP 118. compressedDepth by RVL is not read.
"""

from __future__ import annotations

import struct
from enum import Enum
from typing import Any

import cv2
import numpy as np

from .bag import BadMessage

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"

_COLOR_FLAGS = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION
_DEPTH_HEADER = struct.Struct("<iff")  # of compressedDepth: format, and the two numbers of inverse depth
_PNG = b"\x89PNG"
_PER_METRE = 1000.0  # REP 118: whole numbers are millimetres

# Channels of a colour image, and how it becomes RGB. OpenCV names a Bayer pattern by its second row, ROS by its first.
_COLORS: dict[str, tuple[int, int | None]] = {
    "rgb8": (3, None),
    "bgr8": (3, cv2.COLOR_BGR2RGB),
    "8uc3": (3, cv2.COLOR_BGR2RGB),  # what ROS's own bridge to OpenCV takes it for
    "rgba8": (4, cv2.COLOR_RGBA2RGB),
    "bgra8": (4, cv2.COLOR_BGRA2RGB),
    "mono8": (1, cv2.COLOR_GRAY2RGB),
    "8uc1": (1, cv2.COLOR_GRAY2RGB),
    "yuv422": (2, cv2.COLOR_YUV2RGB_UYVY),
    "uyvy": (2, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2RGB_YUY2),
    "yuyv": (2, cv2.COLOR_YUV2RGB_YUY2),
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2RGB),
    "bayer_bggr8": (1, cv2.COLOR_BayerRG2RGB),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2RGB),
    "bayer_grbg8": (1, cv2.COLOR_BayerGB2RGB),
}
_DEPTHS = {"16uc1": "u2", "mono16": "u2", "32fc1": "f4"}


class ImageKind(Enum):
    """What the images of a topic show."""

    COLOR = "colour"
    GREY = "grey"
    DEPTH = "depth"
    OTHER = "images that are not read"


def encoding_of(message: Any) -> str:
    """`encoding` of an `Image`, `format` of a `CompressedImage`, as the message writes it."""
    return str(getattr(message, "encoding", None) or getattr(message, "format", ""))


def kind_of(message: Any) -> ImageKind:
    """What an `Image` or a `CompressedImage` shows, by its encoding."""
    encoding = encoding_of(message).lower()
    if hasattr(message, "format"):
        if "compresseddepth" in encoding or encoding.startswith(tuple(_DEPTHS)):
            return ImageKind.DEPTH
        return ImageKind.GREY if encoding.startswith(("mono8", "8uc1")) else ImageKind.COLOR
    if encoding in _DEPTHS:
        return ImageKind.DEPTH
    if encoding in ("mono8", "8uc1"):
        return ImageKind.GREY
    return ImageKind.COLOR if encoding in _COLORS else ImageKind.OTHER


def decode_color(message: Any) -> np.ndarray:
    """(H, W, 3) uint8 RGB of an `Image` or a `CompressedImage`.

    Raises:
        BadMessage: the encoding is none of the above, or the data does not fit it.
    """
    if hasattr(message, "format"):
        return _decode(np.asarray(message.data, dtype=np.uint8), _COLOR_FLAGS, encoding_of(message))
    encoding = encoding_of(message).lower()
    if encoding not in _COLORS:
        raise BadMessage(f"colour images of encoding {encoding_of(message)!r} are not read")
    channels, conversion = _COLORS[encoding]
    image = _rows(message, np.dtype("u1"), channels)
    return np.ascontiguousarray(image) if conversion is None else cv2.cvtColor(image, conversion)


def decode_depth(message: Any) -> np.ndarray:
    """(H, W) float32 metres, 0 where there is no reading, of an `Image` or a `CompressedImage`.

    Raises:
        BadMessage: the encoding is none of the above, or the data does not fit it.
    """
    if hasattr(message, "format"):
        return _metres(*_compressed_depth(np.asarray(message.data, dtype=np.uint8), encoding_of(message)))
    encoding = encoding_of(message).lower()
    if encoding not in _DEPTHS:
        raise BadMessage(f"depth images of encoding {encoding_of(message)!r} are not read")
    order = ">" if message.is_bigendian else "<"
    return _metres(_rows(message, np.dtype(order + _DEPTHS[encoding]), 1))


def _rows(message: Any, dtype: np.dtype, channels: int) -> np.ndarray:
    """(H, W) or (H, W, channels) without the bytes that pad the rows."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    used = width * channels * dtype.itemsize
    data = np.asarray(message.data, dtype=np.uint8)
    if height == 0 or width == 0 or step < used or data.size < step * height:
        detail = f"{width} x {height} pixels of {encoding_of(message)} in rows of {step} bytes"
        raise BadMessage(f"{data.size} bytes of data for {detail}")
    rows = np.ascontiguousarray(data[: step * height].reshape(height, step)[:, :used])
    shape = (height, width) if channels == 1 else (height, width, channels)
    return rows.view(dtype).reshape(shape)


def _compressed_depth(data: np.ndarray, encoding: str) -> tuple[np.ndarray, tuple[float, float] | None]:
    """The image as stored, and the two numbers of inverse depth where it is that."""
    if "compresseddepth" not in encoding.lower():
        return _decode(data, cv2.IMREAD_UNCHANGED, encoding), None
    start = _DEPTH_HEADER.size
    if bytes(data[start : start + 4]) != _PNG:
        raise BadMessage(f"depth of format {encoding!r} is not PNG; RVL is not read: record PNG or raw depth")
    _, a, b = _DEPTH_HEADER.unpack(bytes(data[:start]))
    return _decode(data[start:], cv2.IMREAD_UNCHANGED, encoding), (a, b) if "32fc1" in encoding.lower() else None


def _metres(raw: np.ndarray, inverse: tuple[float, float] | None = None) -> np.ndarray:
    if raw.ndim != 2 or raw.dtype.kind + str(raw.dtype.itemsize) not in ("u2", "f4"):
        raise BadMessage(f"depth needs one channel of uint16 or float32, found {raw.shape} of {raw.dtype}")
    if inverse is not None:  # stored is a / depth + b, rounded, and 0 for no reading
        a, b = inverse
        with np.errstate(divide="ignore"):
            depth = np.where(raw > 0, a / (raw.astype(np.float32) - np.float32(b)), 0.0).astype(np.float32)
    elif raw.dtype.kind == "u":
        return np.multiply(raw, np.float32(1.0 / _PER_METRE), dtype=np.float32)
    else:
        depth = raw.astype(np.float32)
    depth[~(np.isfinite(depth) & (depth > 0))] = 0.0
    return depth


def _decode(data: np.ndarray, flags: int, encoding: str) -> np.ndarray:
    image = None
    if data.size:
        try:
            image = cv2.imdecode(np.ascontiguousarray(data), flags)
        except cv2.error:
            image = None
    if image is None:
        raise BadMessage(f"{data.size} bytes of format {encoding!r} cannot be decoded")
    return image
