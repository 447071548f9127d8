"""Depth seen from the colour camera, where a sensor's two cameras were recorded as they are.

A depth pixel becomes a point of the depth camera, p; the colour camera sees it at p' = p + t (the two cameras of such
sensors are parallel to within a fraction of a degree), in pixel K_color p' / z'. The nearest point wins a pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from .frame import Intrinsics


@dataclass(frozen=True, slots=True)
class DepthRegistration:
    """How the depth camera of a sensor stands to its colour camera.

    Attributes:
        depth: intrinsics of the depth image.
        color: intrinsics of the colour image; those of the frames.
        offset: (x, y, z) metres, what is added to a point of the depth camera to have it in the colour camera.
    """

    depth: Intrinsics
    color: Intrinsics
    offset: tuple[float, float, float]

    @property
    def T_depth_color(self) -> np.ndarray:
        """(4, 4) pose of the colour camera in the depth camera's frame."""
        T = np.eye(4)
        T[:3, 3] = -np.array(self.offset)
        return T

    def register(self, depth: np.ndarray) -> np.ndarray:
        """(H, W) float32 metres of the depth camera to the same in the colour camera's pixels, 0 = no reading."""
        registered = np.zeros((self.color.height, self.color.width), dtype=np.float32)
        _register(depth, _parameters(self.depth), _parameters(self.color), np.array(self.offset), registered)
        return registered


def _parameters(k: Intrinsics) -> np.ndarray:
    return np.array([k.fx, k.fy, k.cx, k.cy])


@njit(cache=True, nogil=True)
def _register(depth, source, target, offset, registered):
    height, width = registered.shape
    for v in range(depth.shape[0]):
        y_over_z = (v - source[3]) / source[1]
        for u in range(depth.shape[1]):
            z = depth[v, u]
            if z <= 0.0:
                continue
            moved_z = z + offset[2]
            if moved_z <= 0.0:
                continue
            x = ((u - source[2]) / source[0] * z + offset[0]) / moved_z
            y = (y_over_z * z + offset[1]) / moved_z
            column = int(np.floor(target[0] * x + target[2] + 0.5))
            row = int(np.floor(target[1] * y + target[3] + 0.5))
            if 0 <= column < width and 0 <= row < height:
                nearest = registered[row, column]
                if nearest == 0.0 or moved_z < nearest:
                    registered[row, column] = moved_z
