"""Motion from one frame to the next by optical flow and depth: what leads registration where geometry cannot.

Corners of the last image are followed into the present one (Lucas and Kanade, pyramidal), both ends are lifted by their
depth, and the rigid motion between them is found as for features. Cheaper than matching features, and good for the
few centimetres between frames; asked for only where the registration is in doubt. Where too few can be followed, as
between frames that are far apart, features are matched instead.
"""

from __future__ import annotations

import cv2
import numpy as np

from ....datasets.frame import Frame
from ...config import FlowConfig, VisualConfig
from ..visual.feature_motion import relative_pose, robust_motion
from ..visual.features import FeatureExtractor

FEATURES = VisualConfig()
SCALE = 2  # of the images: half resolution is enough for a guess, and a quarter of the time


class ImageMotion:
    """Remembers the last frame; tells how the camera has moved since."""

    def __init__(self, config: FlowConfig, seed: int = 0) -> None:
        self._config, self._seed = config, seed
        self._last: Frame | None = None

    def remember(self, frame: Frame) -> None:
        """Makes a frame the last one."""
        self._last = frame

    def since_last(self, frame: Frame) -> np.ndarray | None:
        """(4, 4) `T_last_now`; None without an image, or where too few corners and features agree on one."""
        last = self._last
        if last is None or last.color.size == 0 or frame.color.size == 0:
            return None
        followed = self._by_flow(last, frame)
        return followed if followed is not None else self._by_features(last, frame)

    def _by_features(self, last: Frame, frame: Frame) -> np.ndarray | None:
        extract = FeatureExtractor(FEATURES)
        seen = relative_pose(extract(last), extract(frame), FEATURES, self._seed)
        return None if seen is None else seen.T_a_b

    def _by_flow(self, last: Frame, frame: Frame) -> np.ndarray | None:
        c = self._config
        before, now = _small_grey(last), _small_grey(frame)
        corners = cv2.goodFeaturesToTrack(before, c.corners, c.quality, c.spacing)
        if corners is None or len(corners) < c.min_inliers:
            return None
        window = (c.window, c.window)
        start = corners.copy()  # ignored: without OPTFLOW_USE_INITIAL_FLOW corners start where they were
        followed, status, _ = cv2.calcOpticalFlowPyrLK(before, now, corners, start, winSize=window, maxLevel=c.levels)
        found = status[:, 0] > 0
        a, known_a = _lifted(last, corners[found, 0])
        b, known_b = _lifted(frame, followed[found, 0])
        both = known_a & known_b
        fit = robust_motion(b[both], a[both], c.inlier_distance, c.min_inliers, self._seed)
        return None if fit is None else fit.T


def _small_grey(frame: Frame) -> np.ndarray:
    grey = cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY)
    size = grey.shape[1] // SCALE, grey.shape[0] // SCALE
    return cv2.resize(grey, size, interpolation=cv2.INTER_AREA)


def _lifted(frame: Frame, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) camera-frame points of (N, 2) pixels of the small image, and (N,) whether they have depth."""
    k = frame.intrinsics
    full = SCALE * uv.astype(np.float64) + (SCALE - 1) / 2.0
    column, row = np.rint(full).astype(int).T
    inside = (column >= 0) & (row >= 0) & (column < k.width) & (row < k.height)
    z = np.zeros(len(uv))
    z[inside] = frame.depth[row[inside], column[inside]]
    return k.back_project(full, z), z > 0.0
