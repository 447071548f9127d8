"""The landmarks and candidates of a map, and what of them a keyframe should show."""

from __future__ import annotations

import numpy as np

from ...factors.solid import project_solids
from ...factors.visibility import Visibility, VolumePart, measure_visibility
from ..config import AssociationConfig
from .association import Targets
from .landmarks import Landmark
from .tracks import Track
from .view import View

WHOLE = VolumePart.WHOLE


class Scene:
    """Landmarks by number, candidates, and the next numbers of both."""

    def __init__(self) -> None:
        self.landmarks: dict[int, Landmark] = {}
        self.retired: dict[int, Landmark] = {}
        self.tracks: list[Track] = []
        self.next_landmark = 1
        self.next_track = 1

    def members(self) -> list[Landmark | Track]:
        """Landmarks, then tracks: the order of `predict`'s targets."""
        return [*self.landmarks.values(), *self.tracks]

    def predict(self, view: View, config: AssociationConfig, occlusion: bool = True) -> tuple[Targets, Visibility]:
        """Where every member should appear in a view, and how much of it the depth map leaves visible.

        Without `occlusion` the depth map is not asked: nothing is hidden, and nothing is known to be there or not.
        """
        members = self.members()
        positions = np.array([m.position for m in members]).reshape(-1, 3)
        log_sizes = np.array([m.log_size for m in members]).reshape(-1, 3)
        floor = config.position_floor**2 * np.eye(3)
        covariances = np.array([m.covariance + floor for m in members]).reshape(-1, 3, 3)
        camera = view.T_world_camera, view.R_world_upright
        k = view.frame.intrinsics
        visibility = measure_visibility(view.frame.depth, k, *camera, positions, log_sizes)
        if not occlusion:
            visibility = visibility.as_if_clear()
        xyxy, _ = project_solids(*camera, positions, log_sizes, k)
        clipped = np.clip(xyxy, -0.5, np.array([k.width, k.height, k.width, k.height]) - 0.5)
        parts = visibility.visible
        return Targets(positions, covariances, log_sizes, clipped, parts[:, WHOLE], parts, xyxy), visibility
