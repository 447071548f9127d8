"""What can be seen of every object in a frame, counted pixel by pixel."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..frame import Intrinsics
from ..truth import FrameTruth, TrueObject
from .casting import MISS, Caster, pixel_rays
from .render import Cast
from .surfaces import Surfaces

NEAR = 0.05  # metres; things reaching nearer to the camera plane have no finite silhouette and are left out


class Silhouettes:
    """Measures objects in images: the whole silhouette by casting each object alone, the visible part in the scene.

    Boxes are in pixels with pixel centres at integers, as in `Intrinsics`: one pixel (x, y) has the box
    (x - 0.5, y - 0.5, x + 0.5, y + 0.5).
    """

    def __init__(self, objects: tuple[TrueObject, ...], surfaces: Surfaces) -> None:
        self._ids = [thing.id for thing in objects]
        self._owner = surfaces.owner
        self._corners = [surfaces.corners[surfaces.owner == number] for number in self._ids]
        self._alone = [Caster(corners) for corners in self._corners]

    def instances(self, cast: Cast) -> np.ndarray:
        """(H * W,) int32 number of the thing every pixel shows, -1 for the room and where nothing is hit."""
        return np.where(cast.triangle == MISS, np.int32(-1), self._owner[cast.triangle])

    def measure(self, intrinsics: Intrinsics, T_world_camera: np.ndarray, cast: Cast) -> FrameTruth:
        """Truth of the frame that `cast` shows."""
        seen = self.instances(cast).reshape(intrinsics.height, intrinsics.width)
        counts, visible = _extents(seen, max(self._ids, default=-1) + 1)
        rows = []
        for number, corners, caster in zip(self._ids, self._corners, self._alone, strict=True):
            box = projected_box(corners.reshape(-1, 3), intrinsics, T_world_camera)
            if box is None:
                continue
            whole, inside = _silhouette(box, caster, intrinsics, T_world_camera)
            if inside:
                rows.append((number, box, visible[number], min(counts[number] / whole, 1.0)))
        return FrameTruth(
            object_id=np.array([row[0] for row in rows], dtype=np.int64),
            xyxy=np.array([row[1] for row in rows]).reshape(-1, 4),
            xyxy_visible=np.array([row[2] for row in rows]).reshape(-1, 4),
            visibility=np.array([row[3] for row in rows], dtype=np.float64),
        )


def projected_box(points: np.ndarray, intrinsics: Intrinsics, T_world_camera: np.ndarray) -> np.ndarray | None:
    """(4,) xyxy pixels of the projections of (N, 3) world points, or None where one is not in front of the camera."""
    camera = (points.astype(np.float64) - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
    if camera[:, 2].min() < NEAR:
        return None
    uv = intrinsics.project(camera)
    return np.concatenate([uv.min(axis=0), uv.max(axis=0)])


def _silhouette(box: np.ndarray, caster: Caster, intrinsics: Intrinsics, T_world_camera: np.ndarray) -> tuple[int, int]:
    """Pixels of the whole silhouette, and how many of them lie inside the image."""
    left, top = (int(v) for v in np.ceil(box[:2]))
    right, bottom = (int(v) + 1 for v in np.floor(box[2:]))
    if left >= intrinsics.width or top >= intrinsics.height or right <= 0 or bottom <= 0:
        return 0, 0
    width, height = right - left, bottom - top
    if width <= 0 or height <= 0:
        return 0, 0
    rays = pixel_rays(intrinsics, T_world_camera, (left, top), (width, height))
    hit = (caster.first_hit(*rays) != MISS).reshape(height, width)
    inside = hit[max(-top, 0) : intrinsics.height - top, max(-left, 0) : intrinsics.width - left]
    return int(hit.sum()), int(inside.sum())


@njit(cache=True)
def _extents(seen, number):
    """Pixels of every thing, and the boxes around them (NaN where there are none)."""
    counts = np.zeros(number, np.int64)
    box = np.full((number, 4), np.nan)
    for y in range(seen.shape[0]):
        for x in range(seen.shape[1]):
            k = seen[y, x]
            if k < 0 or k >= number:
                continue
            if counts[k] == 0:
                box[k, 0], box[k, 1], box[k, 2], box[k, 3] = x - 0.5, y - 0.5, x + 0.5, y + 0.5
            counts[k] += 1
            box[k, 0] = min(box[k, 0], x - 0.5)
            box[k, 2] = max(box[k, 2], x + 0.5)
            box[k, 3] = y + 0.5
    return counts, box
