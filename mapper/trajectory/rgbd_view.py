"""The two images of a frame, and nothing else: small enough to be handed to another process."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...datasets.frame import Frame, Intrinsics


@dataclass(frozen=True, slots=True, eq=False)
class RgbdView:
    """(H, W, 3) uint8 RGB, (H, W) float32 metres along z (0 = no reading), and the camera of both."""

    color: np.ndarray
    depth: np.ndarray
    intrinsics: Intrinsics

    @classmethod
    def of(cls, frame: Frame) -> RgbdView:
        """A frame's images, not copied."""
        return cls(frame.color, frame.depth, frame.intrinsics)

    def points(self, step: int, depth_range: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """(N, 2) int pixels x, y, every `step`-th in both directions with depth in range, and (N, 3) points, metres."""
        v, u = np.mgrid[step // 2 : self.depth.shape[0] : step, step // 2 : self.depth.shape[1] : step]
        z = self.depth[v, u]
        valid = (z > depth_range[0]) & (z < depth_range[1])
        pixels = np.stack([u[valid], v[valid]], axis=1)
        return pixels, self.intrinsics.back_project(pixels, z[valid].astype(np.float64))
