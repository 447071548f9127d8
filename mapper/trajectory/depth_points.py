"""Points of a depth image, as registrations take them."""

from __future__ import annotations

import numpy as np

from ...datasets.frame import BrokenFrame, Frame, FrameProblem

MIN_POINTS = 200  # fewer depth readings than this cannot be registered


class DepthPoints:
    """Every few pixels' points within range; the rays of the pixels are kept, so all frames are of one camera.

    Args:
        pixel_step: pixels between points, in both directions.
        min_range, max_range: metres along z.
    """

    def __init__(self, pixel_step: int, min_range: float, max_range: float) -> None:
        self._step, self._range = pixel_step, (min_range, max_range)
        self._rays: np.ndarray | None = None

    def __call__(self, frame: Frame) -> np.ndarray:
        """(N, 3) float64 metres, camera frame.

        Raises:
            BrokenFrame: fewer than `MIN_POINTS` readings in range.
        """
        k, step = frame.intrinsics, self._step
        offset = step // 2
        z = frame.depth[offset::step, offset::step]
        if self._rays is None or self._rays.shape[:2] != z.shape:
            v, u = np.mgrid[offset : k.height : step, offset : k.width : step]
            self._rays = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones(u.shape)], axis=-1)
        valid = (z > self._range[0]) & (z < self._range[1])
        points = self._rays[valid] * z[valid].astype(np.float64)[:, None]
        if len(points) < MIN_POINTS:
            raise BrokenFrame(frame.name, FrameProblem.NO_DEPTH, f"{len(points)} readings in range")
        return points
