"""Keyframes that can be recognised: one for every stretch of the way, however often it is gone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...config import LoopConfig, PlaceConfig
from ..rigid import inverse
from ..visual.features import Features
from .place_index import PlaceIndex
from .scan_matching import Scan


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """What a keyframe is recognised by."""

    keyframe: int
    features: Features
    scan: Scan


class Places:
    """Remembers keyframes that show something new, so that memory grows with the space seen and not with time."""

    def __init__(self, loops: LoopConfig, index: PlaceConfig) -> None:
        self._config = loops
        self._index = PlaceIndex(index)
        self._places: dict[int, Place] = {}
        self._keyframes = np.empty(0, dtype=int)

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, keyframe: int) -> Place:
        return self._places[keyframe]

    @property
    def keyframes(self) -> np.ndarray:
        """(P,) numbers of the keyframes that are remembered, ascending."""
        return self._keyframes

    def offer(self, place: Place, T_world_camera: np.ndarray) -> bool:
        """Remembers the latest keyframe, given the (M, 4, 4) poses of all, if nothing near it is; whether it does."""
        spacing = self._config.place_spacing
        turned, moved = self.distances(T_world_camera, place.keyframe)
        if np.any((turned < spacing[0]) & (moved < spacing[1])):
            return False
        self._places[place.keyframe] = place
        self._keyframes = np.append(self._keyframes, place.keyframe)
        if self._config.appearance:
            self._index.add(place.keyframe, place.features.descriptors)
        return True

    def distances(self, T_world_camera: np.ndarray, keyframe: int) -> tuple[np.ndarray, np.ndarray]:
        """(P,) rad and (P,) m between a keyframe and every place, under the given (M, 4, 4) poses."""
        relative = inverse(T_world_camera[keyframe]) @ T_world_camera[self._keyframes]
        cosine = (np.trace(relative[:, :3, :3], axis1=1, axis2=2) - 1.0) / 2.0
        return np.arccos(np.clip(cosine, -1.0, 1.0)), np.linalg.norm(relative[:, :3, 3], axis=1)

    def alike(self, features: Features, count: int, exclude_after: int) -> list[Place]:
        """Places that look like an image, the likeliest first, of keyframes numbered at most `exclude_after`."""
        if not self._config.appearance:
            return []
        return [self._places[m.keyframe] for m in self._index.query(features.descriptors, count, exclude_after)]
