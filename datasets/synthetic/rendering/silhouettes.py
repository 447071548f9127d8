"""What can be seen of every object in a frame, counted pixel by pixel."""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.spatial import ConvexHull, QhullError

from ...frame import Intrinsics
from ...truth import NO_OBJECT, PARTS, FrameTruth, TrueObject
from .casting import MISS, Caster, pixel_rays
from .render import Cast
from .surfaces import Surfaces

NEAR = 0.05  # metres; things reaching nearer to the camera plane have no finite silhouette and are left out
STRIP = 1 << 18  # rays cast at once: a thing close to the camera may reach far outside the image


class Silhouettes:
    """Measures objects in images: the whole silhouette by casting each object alone, the visible part in the scene.

    Boxes are in pixels with pixel centres at integers, as in `Intrinsics`: one pixel (x, y) has the box
    (x - 0.5, y - 0.5, x + 0.5, y + 0.5). Halves are those of the whole silhouette's box; a pixel whose centre lies on
    the line between them belongs to the lower or right one.
    """

    def __init__(self, objects: tuple[TrueObject, ...], surfaces: Surfaces) -> None:
        self._ids = [thing.id for thing in objects]
        self._owner = surfaces.owner
        corners = [surfaces.corners[surfaces.owner == number] for number in self._ids]
        self._outline = [_outermost(of_one.reshape(-1, 3)) for of_one in corners]
        self._alone = [Caster(of_one) for of_one in corners]

    def instances(self, cast: Cast) -> np.ndarray:
        """(H * W,) int32 number of the thing every pixel shows, `NO_OBJECT` for the room and where nothing is hit."""
        return np.where(cast.triangle == MISS, np.int32(NO_OBJECT), self._owner[cast.triangle])

    def measure(self, intrinsics: Intrinsics, T_world_camera: np.ndarray, cast: Cast) -> FrameTruth:
        """Truth of the frame that `cast` shows."""
        seen = self.instances(cast).reshape(intrinsics.height, intrinsics.width)
        visible = _extents(seen, max(self._ids, default=-1) + 1)
        rows = []
        for number, points, caster in zip(self._ids, self._outline, self._alone, strict=True):
            box = projected_box(points, intrinsics, T_world_camera)
            if box is None:
                continue
            counts, in_image = _count_silhouette(box, caster, intrinsics, T_world_camera, seen, number)
            if in_image:
                rows.append((number, box, visible[number], _shares(counts)))
        shares = np.array([row[3] for row in rows], dtype=np.float64).reshape(-1, len(PARTS))
        return FrameTruth(
            object_id=np.array([row[0] for row in rows], dtype=np.int64),
            xyxy=np.array([row[1] for row in rows]).reshape(-1, 4),
            xyxy_visible=np.array([row[2] for row in rows]).reshape(-1, 4),
            visibility=shares[:, 0].copy(),
            part_visibility=shares,
        )


def projected_box(points: np.ndarray, intrinsics: Intrinsics, T_world_camera: np.ndarray) -> np.ndarray | None:
    """(4,) xyxy pixels of the projections of (N, 3) world points, or None where one is not in front of the camera."""
    camera = (points.astype(np.float64) - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
    if camera[:, 2].min() < NEAR:
        return None
    uv = intrinsics.project(camera)
    return np.concatenate([uv.min(axis=0), uv.max(axis=0)])


def _outermost(points: np.ndarray) -> np.ndarray:
    """The points on the convex hull, which decide about every projection's box; all of a flat thing's."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return points


def _count_silhouette(
    box: np.ndarray, caster: Caster, intrinsics: Intrinsics, T_world_camera: np.ndarray, seen: np.ndarray, number: int
) -> tuple[np.ndarray, int]:
    """Pixels of the thing in the rectangle `box`; all zero where that lies outside the image.

    Returns:
        (2, 5) pixels of the whole silhouette and of what is visible, by part; how many of the whole lie in the image.
    """
    counts, in_image = np.zeros((2, len(PARTS)), np.int64), 0
    left, top = (int(v) for v in np.ceil(box[:2]))
    right, bottom = (int(v) + 1 for v in np.floor(box[2:]))
    if left >= intrinsics.width or top >= intrinsics.height or right <= max(left, 0) or bottom <= 0:
        return counts, 0
    middle = (box[0] + box[2]) / 2.0, (box[1] + box[3]) / 2.0
    rows = max(STRIP // (right - left), 1)
    for start in range(top, bottom, rows):
        size = (right - left, min(rows, bottom - start))
        rays = pixel_rays(intrinsics, T_world_camera, (left, start), size)
        hit = (caster.first_hit(*rays) != MISS).reshape(size[::-1])
        in_image += _count_parts(hit, seen, number, left, start, *middle, counts)
    return counts, in_image


def _shares(counts: np.ndarray) -> np.ndarray:
    """(5,) visible shares by part; a part without pixels has the share of the whole.

    At outlines a ray may hit the thing in the scene and miss it alone, so that shares are cut at 1.
    """
    whole, visible = counts
    shares = np.full(len(PARTS), min(visible[0] / whole[0], 1.0))
    there = whole > 0
    shares[there] = np.minimum(visible[there] / whole[there], 1.0)
    return shares


@njit(cache=True, nogil=True)
def _count_parts(hit, seen, number, left, top, middle_x, middle_y, counts):
    """Add a rectangle's pixels to `counts`; how many of the silhouette's lie inside the image."""
    inside = 0
    for row in range(hit.shape[0]):
        y = top + row
        upper_or_lower = 1 if y < middle_y else 2
        for column in range(hit.shape[1]):
            x = left + column
            side = 3 if x < middle_x else 4
            in_image = 0 <= y < seen.shape[0] and 0 <= x < seen.shape[1]
            if hit[row, column]:
                counts[0, 0] += 1
                counts[0, upper_or_lower] += 1
                counts[0, side] += 1
                inside += in_image
            if in_image and seen[y, x] == number:
                counts[1, 0] += 1
                counts[1, upper_or_lower] += 1
                counts[1, side] += 1
    return inside


@njit(cache=True, nogil=True)
def _extents(seen, number):
    """(number, 4) boxes around the pixels of every thing; NaN where there are none."""
    box = np.full((number, 4), np.nan)
    for y in range(seen.shape[0]):
        for x in range(seen.shape[1]):
            k = seen[y, x]
            if k < 0 or k >= number:
                continue
            if np.isnan(box[k, 0]):
                box[k, 0], box[k, 1], box[k, 2], box[k, 3] = x - 0.5, y - 0.5, x + 0.5, y + 0.5
            box[k, 0] = min(box[k, 0], x - 0.5)
            box[k, 2] = max(box[k, 2], x + 0.5)
            box[k, 3] = y + 0.5
    return box
