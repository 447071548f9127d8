"""Pieces of images that speak for a thing or against it, with its box drawn in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ....datasets.frame import Frame
from ...estimation.view_log import FAINT
from ...map.boxes import EDGES
from ...map.explanation import ViewExplanation

EACH = 3  # for and against
MOST = 600  # on one page, 4 MB; with more things each gets fewer, and the less probable ones none
HIGH = 168  # pixels: largest side of a crop
LOW = 64  # pixels of the image that a crop shows at least
MARGIN = 0.3  # of the box's size in the image, shown around it
QUALITY = 80  # JPEG
NEAR = 0.05  # m before the camera: lines are cut there
FIXED = 4  # bits after the point of pixels that OpenCV draws at
UNDER = (20, 23, 29)  # RGB under the lines, so that they are seen on any ground


@dataclass(frozen=True, slots=True, eq=False)
class Crop:
    """A JPEG of `width` x `height` pixels."""

    jpeg: bytes
    width: int
    height: int


def per_thing(things: int) -> int:
    """How many crops for and how many against each thing may have, where there are so many things; at least one."""
    return max(1, min(EACH, MOST // (2 * max(things, 1))))


def choose(views: Sequence[ViewExplanation], speaking_for: bool, count: int) -> list[ViewExplanation]:
    """The views with the largest log ratios for (or against), strongest first, spread in time where there are more.

    A view is first left for later where a stronger one is nearer than a (2 count)-th of the time between the first
    and the last of them; if too few are left, those follow after all.
    """
    sign = 1.0 if speaking_for else -1.0
    speaking = sorted((v for v in views if sign * v.log_ratio > FAINT), key=lambda v: (-abs(v.log_ratio), v.stamp))
    if not speaking:
        return []
    stamps = [view.stamp for view in speaking]
    apart = (max(stamps) - min(stamps)) / (2.0 * count)
    chosen: list[ViewExplanation] = []
    for view in speaking:
        if len(chosen) < count and all(abs(view.stamp - other.stamp) >= apart for other in chosen):
            chosen.append(view)
    later = [view for view in speaking if view not in chosen]
    chosen += later[: count - len(chosen)]
    return sorted(chosen, key=lambda v: (-abs(v.log_ratio), v.stamp))


def cut(frame: Frame, T_world_camera: np.ndarray, corners: np.ndarray, rgb: np.ndarray) -> Crop | None:
    """The image around a box.

    Args:
        frame: with an image.
        T_world_camera: (4, 4) its camera in the map.
        corners: (8, 3) of the box, metres, map frame, as `box_corners` orders them.
        rgb: (3,) uint8 of the lines.

    Returns:
        None where the box is not in the image.
    """
    local = (corners - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
    ends = _before_camera(local[EDGES])
    if len(ends) == 0:
        return None
    uv = frame.intrinsics.project(ends.reshape(-1, 3))
    high, wide = frame.color.shape[:2]
    low, up = np.maximum(uv.min(axis=0), 0.0), np.minimum(uv.max(axis=0), [wide - 1.0, high - 1.0])
    if np.any(up - low < 2.0):
        return None
    half = np.maximum((0.5 + MARGIN) * (up - low), LOW / 2.0)
    x0, y0 = np.maximum(np.floor((low + up) / 2.0 - half), 0).astype(int)
    x1, y1 = np.minimum(np.ceil((low + up) / 2.0 + half) + 1, [wide, high]).astype(int)
    scale = HIGH / max(x1 - x0, y1 - y0)
    size = max(1, round(scale * (x1 - x0))), max(1, round(scale * (y1 - y0)))
    how = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_CUBIC
    image = cv2.resize(np.ascontiguousarray(frame.color[y0:y1, x0:x1]), size, interpolation=how)
    lines = _fixed((uv - [x0, y0] + 0.5) * scale - 0.5)
    for paint, width in ((UNDER, 3), (tuple(int(band) for band in rgb), 1)):
        cv2.polylines(image, list(lines), False, paint, width, cv2.LINE_AA, FIXED)
    good, jpeg = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return Crop(jpeg.tobytes(), *size) if good else None


def _before_camera(ends: np.ndarray) -> np.ndarray:
    """(E, 2, 3) lines in camera axes, cut where they come nearer than `NEAR`, without those that are all behind."""
    order = np.argsort(ends[:, :, 2], axis=1)[:, :, None]
    ends = np.take_along_axis(ends, order, axis=1)
    behind, before = ends[:, 0], ends[:, 1]
    shown = before[:, 2] > NEAR
    behind, before = behind[shown], before[shown]
    share = np.clip((NEAR - behind[:, 2]) / np.maximum(before[:, 2] - behind[:, 2], 1e-12), 0.0, 1.0)[:, None]
    return np.stack([behind + share * (before - behind), before], axis=1)


def _fixed(uv: np.ndarray) -> np.ndarray:
    """(2 E, 2) pixels to (E, 2, 1, 2) as OpenCV draws them, in 1/16 pixel; far outside they are held back."""
    return np.round(np.clip(uv, -4000.0, 4000.0) * (1 << FIXED)).astype(np.int32).reshape(-1, 2, 1, 2)
