"""The coloured cloud as a shaded image and its depth: one disc per point, through a z-buffer."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from thingmap.datasets.frame import Intrinsics
from thingmap.mapper.trajectory.cloud import voxel_keys

from .scene import Scene, View

SMALLEST, LARGEST = 2.0, 0.02  # radius of a disc: pixels, share of the image's width
GROUND_TOP, GROUND_BOTTOM = (44, 51, 63), (17, 20, 26)  # RGB


def draw_cloud(scene: Scene, view: View) -> tuple[np.ndarray, np.ndarray]:
    """(H, W, 3) uint8 RGB and (H, W) float32 depth, metres, infinite where there is no point."""
    spacing = spacing_of(scene.points)
    shown = in_sight(scene, view, spacing)
    color, depth = splat(view.to_view(scene.points[shown]), scene.colors[shown], view.intrinsics, spacing)
    return shaded(color, depth, scene, view, spacing), depth


def spacing_of(points: np.ndarray) -> float:
    """Metres from a point to its fourth neighbour, the median over some points."""
    fourth = min(4, len(points) - 1)
    some = points[np.linspace(0, len(points) - 1, min(len(points), 100)).astype(int)]
    squares = [np.partition(np.sum((points - point) ** 2, axis=1), fourth)[fourth] for point in some]
    return max(float(np.sqrt(np.median(squares))), 0.001)


def in_sight(scene: Scene, view: View, spacing: float) -> np.ndarray:
    """(M,) bool: points that are not strays, and not of a wall or ceiling between the viewer and the things."""
    _, cell, count = np.unique(voxel_keys(scene.points, 2.5 * spacing), return_inverse=True, return_counts=True)
    depth, height = view.to_view(scene.points)[:, 2], scene.points @ scene.R_world_upright[:, 2]
    corners = scene.corners.reshape(-1, 3)
    tall = height > np.max(corners @ scene.R_world_upright[:, 2]) + 0.05
    before = depth < np.median(view.to_view(corners)[:, 2])
    nearest = max(float(view.to_view(scene.extent)[:, 2].min()) - 0.1, 0.05)
    return (count[cell] >= 3) & (depth > nearest) & ~(before & tall)


def splat(points: np.ndarray, colors: np.ndarray, k: Intrinsics, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Points as discs that face the view and are wide enough to close a surface of points `spacing` apart.

    A first pass finds the nearest disc at every pixel, a second averages the discs that lie little behind it.

    Args:
        points: (N, 3) view coordinates, metres, in front of the view.
        colors: (N, 3) uint8 RGB.
        k: of the image.
        spacing: metres.

    Returns:
        (H, W, 3) float32 RGB and (H, W) float32 depth, metres, infinite where there is no disc.
    """
    radius = np.clip(0.75 * spacing * k.fx / points[:, 2], SMALLEST, LARGEST * k.width)
    most = int(radius.max(initial=SMALLEST))
    pad = 2 * most + 1  # then no disc leaves the buffer whose centre is at most its radius outside the image
    wide, high = k.width + 2 * pad, k.height + 2 * pad
    column, row = np.round(k.project(points) + pad).astype(np.int64).T
    inside = (column >= most) & (column < wide - most) & (row >= most) & (row < high - most)
    order = np.flatnonzero(inside)[np.argsort(-points[inside, 2], kind="stable")]  # far to near, so small to large
    pixel, z, radius = (row * wide + column)[order], points[order, 2].astype(np.float32), radius[order]
    paint = np.column_stack([colors[order], z, np.ones_like(z)]).astype(np.float32)
    nearest, total = np.full(wide * high, np.inf, dtype=np.float32), np.zeros((wide * high, 5), dtype=np.float32)
    for first, at, _ in _disc_pixels(pixel, radius, wide):
        nearer = z[first:] < nearest[at]
        nearest[at[nearer]] = z[first:][nearer]  # the last of several is the nearest
    for first, at, squared in _disc_pixels(pixel, radius, wide):
        front = np.flatnonzero(z[first:] < nearest[at] + 1.5 * spacing)
        weight = (1.001 - squared / radius[first:][front] ** 2) ** 2
        total[at[front]] += weight[:, None].astype(np.float32) * paint[first:][front]
    total = total.reshape(high, wide, 5)[pad:-pad, pad:-pad]
    mean = total[..., :4] / np.maximum(total[..., 4:], 1e-9)
    return mean[..., :3], np.where(total[..., 4] > 0.0, mean[..., 3], np.inf).astype(np.float32)


def _disc_pixels(pixel: np.ndarray, radius: np.ndarray, wide: int) -> Iterator[tuple[int, np.ndarray, int]]:
    """One pixel of all discs at a time: where the discs that have it begin, their flat indices, its squared distance.

    `pixel` (N,) are the centres in an image `wide` pixels wide, `radius` (N,) rises.
    """
    most = int(radius.max(initial=0.0))
    for dy in range(-most, most + 1):
        for dx in range(-most, most + 1):
            first = int(np.searchsorted(radius, np.hypot(dx, dy)))
            yield first, pixel[first:] + dy * wide + dx, dx * dx + dy * dy


def shaded(color: np.ndarray, depth: np.ndarray, scene: Scene, view: View, spacing: float) -> np.ndarray:
    """(H, W, 3) uint8: darker right behind a nearer surface, fading into the ground with distance from the things."""
    k = view.intrinsics
    z = np.minimum(depth, 100.0)
    step = (z - cv2.erode(z, np.ones((5, 5), dtype=np.uint8))) / spacing
    dark = np.where(np.isfinite(depth), 1.0 - 0.35 * np.clip(step / 3.0 - 1.0, 0.0, 1.0), 1.0)
    v, u = np.mgrid[: k.height, : k.width].astype(np.float32)
    points = np.stack([(u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z], axis=-1)
    extent = view.to_view(scene.extent)
    centre = np.median(view.to_view(scene.corners.reshape(-1, 3)), axis=0)
    away = np.linalg.norm(points - centre.astype(np.float32), axis=-1)
    away = np.clip(away / np.linalg.norm(extent - centre, axis=1).max() - 0.75, 0.0, 1.0)
    fade = np.where(np.isfinite(depth), 0.7 * away * away * (3.0 - 2.0 * away), 1.0)[..., None]
    ground = np.linspace(GROUND_TOP, GROUND_BOTTOM, k.height)[:, None]
    return np.clip(color * dark[..., None] * (1.0 - fade) + ground * fade, 0.0, 255.0).astype(np.uint8)
