"""Image features that have depth: what a keyframe is recognised by."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ....datasets.frame import Frame
from ...config import VisualConfig


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """ORB features of a frame (Rublee et al. 2011) that have depth.

    Attributes:
        descriptors: (N, 32) uint8.
        points: (N, 3) camera frame, metres.
    """

    descriptors: np.ndarray
    points: np.ndarray

    def __len__(self) -> int:
        return len(self.points)


class FeatureExtractor:
    """Finds features; the same image gives the same ones."""

    def __init__(self, config: VisualConfig) -> None:
        self._config = config
        self._orb = cv2.ORB.create(config.features, fastThreshold=config.fast_threshold)
        self._faint = cv2.ORB.create(config.faint_features, fastThreshold=config.faint_threshold)

    def __call__(self, frame: Frame) -> Features:
        """Features within the depth range; where an image shows few of them, faint ones too."""
        grey = cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY)
        features = self._features(self._orb, grey, frame)
        return features if len(features) >= self._config.few_features else self._features(self._faint, grey, frame)

    def _features(self, orb: cv2.ORB, grey: np.ndarray, frame: Frame) -> Features:
        found, descriptors = orb.detectAndCompute(grey, None)
        if descriptors is None:
            return Features(np.empty((0, 32), dtype=np.uint8), np.empty((0, 3)))
        uv = np.array([p.pt for p in found])
        column, row = np.rint(uv).astype(int).T
        z = frame.depth[row, column].astype(np.float64)
        low, high = self._config.depth_range
        usable = (z > low) & (z < high)
        return Features(descriptors[usable], frame.intrinsics.back_project(uv[usable], z[usable]))
