"""Boxes, ellipses and the camera's path: lines in space that the cloud may hide, and what is drawn over it."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import cv2
import numpy as np

from thingmap.mapper import Thing

from .scene import Color, View

FRUSTUMS = 6  # cameras drawn along the path
WHITE, INK = (242, 245, 250), (20, 23, 29)  # RGB


class Pen:
    """Draws on `image`, (H, W, 3) uint8 RGB, a picture of `view`; what lies behind `depth`, (H, W), metres, is hidden.

    Widths are in pixels of a picture 1600 wide, whatever the size of this one.
    """

    def __init__(self, view: View, image: np.ndarray, depth: np.ndarray) -> None:
        self.view, self.image, self.depth = view, image, depth
        self.unit = view.intrinsics.width / 1600.0

    def segments(self, ends: np.ndarray, color: Color, width: float, opacity: float = 1.0) -> None:
        """(N, 2, 3) lines in map coordinates; what the cloud hides of them is thin and faint."""
        hidden: list[np.ndarray] = []
        shown: list[np.ndarray] = []
        for a, b in ends:
            length = float(np.linalg.norm(np.diff(self.view.project(np.stack([a, b])), axis=0)))
            points = a + np.linspace(0.0, 1.0, max(int(length / (2.0 * self.unit)), 2) + 1)[:, None] * (b - a)
            visible, uv = self._visible((points[1:] + points[:-1]) / 2.0), self.view.project(points)
            changes = [0, *(np.flatnonzero(np.diff(visible.astype(int))) + 1).tolist(), len(visible)]
            for start, end in pairwise(changes):
                (shown if visible[start] else hidden).append(uv[start : end + 1])
        self.strokes(hidden, color, 0.6 * width, 0.4 * opacity)
        self.strokes(shown, INK, width + 1.6, 0.4 * opacity)
        self.strokes(shown, color, width, opacity)

    def _visible(self, points: np.ndarray) -> np.ndarray:
        """(N,) bool for points along a line; where the cloud's depth is noise, the neighbours have the majority."""
        column, row = np.round(self.view.project(points)).astype(int).T
        inside = (column >= 0) & (column < self.depth.shape[1]) & (row >= 0) & (row < self.depth.shape[0])
        behind = np.zeros(len(points), dtype=np.float32)
        z = self.view.to_view(points)[:, 2]
        behind[inside] = z[inside] > self.depth[row[inside], column[inside]] + 0.01
        return cv2.blur(behind[None], (9, 1), borderType=cv2.BORDER_REPLICATE)[0] <= 0.5

    def strokes(self, lines: Iterable[np.ndarray], color: Color, width: float, opacity: float = 1.0) -> None:
        """Polylines, each (N, 2) pixels."""
        over = self.image.copy()
        thickness = max(1, round(width * self.unit))
        cv2.polylines(over, [_fixed(uv) for uv in lines], False, color, thickness, cv2.LINE_AA, 4)
        cv2.addWeighted(over, opacity, self.image, 1.0 - opacity, 0.0, self.image)

    def area(self, outline: np.ndarray, color: Color, opacity: float) -> None:
        """A (N, 2) polygon with a white rim; its inside lets half of the picture through."""
        over = self.image.copy()
        cv2.fillPoly(over, [_fixed(outline)], color, cv2.LINE_AA, 4)
        cv2.addWeighted(over, 0.5 * opacity, self.image, 1.0 - 0.5 * opacity, 0.0, self.image)
        for rim, width in ((INK, 2.6), (WHITE, 1.2)):
            self.strokes([np.concatenate([outline, outline[:1]])], rim, width, opacity)


def _fixed(uv: np.ndarray) -> np.ndarray:
    """(N, 2) pixels as OpenCV wants them, in 1/16 pixel."""
    return np.round(uv * 16.0).astype(np.int32)[:, None]


def ellipse_outline(view: View, thing: Thing, count: int = 48) -> np.ndarray:
    """(count, 2) pixels around the 2-sigma ellipse of a thing's position: its covariance, projected to first order."""
    x, y, z = view.to_view(thing.position[None])[0]
    k = view.intrinsics
    jacobian = np.array([[k.fx / z, 0.0, -k.fx * x / z**2], [0.0, k.fy / z, -k.fy * y / z**2]])
    jacobian = jacobian @ view.T_world_view[:3, :3].T
    variances, axes = np.linalg.eigh(jacobian @ thing.position_covariance @ jacobian.T)
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return view.project(thing.position[None]) + circle * 2.0 * np.sqrt(np.maximum(variances, 0.0)) @ axes.T


def path_segments(poses: np.ndarray, size: float) -> np.ndarray:
    """(N, 2, 3) line segments: from pose to pose, and some cameras `size` metres deep at equal distances."""
    at = poses[:, :3, 3]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(at, axis=0), axis=1))])
    chosen = poses[np.unique(np.searchsorted(along, np.linspace(0.0, along[-1], FRUSTUMS)))]
    rim = size * np.array([[-0.6, -0.45, 1.0], [0.6, -0.45, 1.0], [0.6, 0.45, 1.0], [-0.6, 0.45, 1.0]])
    rims = rim @ chosen[:, :3, :3].transpose(0, 2, 1) + chosen[:, None, :3, 3]
    tips = np.broadcast_to(chosen[:, None, :3, 3], rims.shape)
    pairs = [(at[:-1], at[1:]), (tips, rims), (rims, np.roll(rims, 1, axis=1))]
    return np.concatenate([np.stack([a.reshape(-1, 3), b.reshape(-1, 3)], axis=1) for a, b in pairs])
