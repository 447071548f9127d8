"""When poses are corrected, everything follows that was seen from them.

A loop closure moves keyframes by decimetres at once. Positions and sizes of landmarks are variables of the same graph
and move by themselves. What does not is brought along here:

    candidates          their filters go through their observations again (`Track.follow`)
    places of looks     looked up by keyframe (`ViewCells.place_anew`); presence goes by their numbers, which stay
    retired landmarks   are in no graph: they move with the keyframes that saw them
    what is there twice becomes one (`Lifecycle.reunite`)

Before that, where a loop was closed: a landmark into which two things went while the poses were wrong becomes two
(`Lifecycle.separate`). Such a landmark may hold the poses against the loop, which then have not even moved.

The cloud has `KeyframeCloud.rebuild`, since nothing here depends on it.
"""

from __future__ import annotations

import numpy as np

from ..config import CorrectionConfig, TrackConfig
from .landmarks import Landmark
from .lifecycle import Lifecycle
from .mix_ups import disobeys
from .records import Loop
from .scene import Scene
from .smoother import Smoother

REUNIONS = 5  # at most; each merger moves what it merged, so that another may become possible


class PoseWatch:
    """Keyframe poses as they were when everything was last brought along."""

    def __init__(self, config: CorrectionConfig) -> None:
        self._config = config
        self._poses = np.empty((0, 4, 4))

    def __len__(self) -> int:
        return len(self._poses)

    def moved(self, T_world_keyframe: np.ndarray) -> bool:
        """Whether some keyframe, of (M, 4, 4), is now elsewhere by more than the tolerance.

        Keyframes that are new are remembered as they are now.
        """
        known = len(self)
        self._poses = np.concatenate([self._poses, T_world_keyframe[known:]])
        now, old = T_world_keyframe[:known], self._poses[:known]
        trace = (now[:, :3, :3] * old[:, :3, :3]).sum(axis=(1, 2))  # of R_now R_old^T
        angle = np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))
        shift = np.linalg.norm(now[:, :3, 3] - old[:, :3, 3], axis=1)
        return bool(np.any(shift > self._config.translation) or np.any(angle > self._config.rotation))

    def corrections(self, T_world_keyframe: np.ndarray) -> np.ndarray:
        """(M, 4, 4) `T_new_old`, world axes: what takes a place seen from a keyframe to where it belongs now."""
        return T_world_keyframe @ np.linalg.inv(self._poses)

    def remember(self, T_world_keyframe: np.ndarray) -> None:
        """Everything has been brought along to these (M, 4, 4) poses."""
        self._poses = T_world_keyframe.copy()


class Followers:
    """All that is known of things outside the graph, brought along with the poses it was seen from.

    Args:
        scene: whose members follow.
        smoother: whose poses are followed.
        lifecycle: which makes one of what is there twice.
        tracks: drift of candidates.
        config: when poses count as corrected.
    """

    def __init__(
        self,
        scene: Scene,
        smoother: Smoother,
        lifecycle: Lifecycle,
        tracks: TrackConfig,
        config: CorrectionConfig,
    ) -> None:
        self._scene, self._smoother, self._lifecycle, self._tracks = scene, smoother, lifecycle, tracks
        self._watch = PoseWatch(config)
        self._closed: set[int] = set()  # loop closures that were looked at, by number

    def follow(self) -> bool:
        """Brings everything to the poses of the updated smoother; whether they had been corrected at all.

        To be called after every update of the smoother that added a keyframe: it is then known where each was.
        """
        poses = self._smoother.poses()
        moved, closed = self._watch.moved(poses), self._newly_closed()
        if closed and (moved or any(disobeys(loop, poses) for loop in closed)):
            moved |= self._lifecycle.separate()
        if not moved:
            return False
        for _ in range(REUNIONS):
            self._bring_along()
            if not self._lifecycle.reunite():
                break
        else:
            self._bring_along()
        return True

    def _newly_closed(self) -> list[Loop]:
        """Loop closures that came since the last time."""
        loops = self._smoother.loops()
        closed = [loop for number, loop in loops.items() if number not in self._closed]
        self._closed = set(loops)
        return closed

    def _bring_along(self) -> None:
        self._lifecycle.bring_up_to_date()
        poses = self._smoother.poses()
        cameras, corrections = poses[:, :3, 3], self._watch.corrections(poses)
        for track in self._scene.tracks:
            track.follow(poses, self._tracks)
        for landmark in self._scene.retired.values():
            _move(landmark, corrections)
        for member in (*self._scene.members(), *self._scene.retired.values()):
            member.belief.place_anew(cameras, member.position)
        self._watch.remember(poses)


def _move(landmark: Landmark, corrections: np.ndarray) -> None:
    """Moves what is in no graph by the mean of the corrections (M, 4, 4) of the keyframes that showed it."""
    seen = sorted(landmark.supporting or landmark.contradicting or landmark.occluded)
    if not seen:
        return
    T = corrections[seen].mean(axis=0)
    U, _, Vt = np.linalg.svd(T[:3, :3])  # the rotation nearest to the mean of rotations
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    landmark.position = T[:3, :3] @ landmark.position + T[:3, 3]
    landmark.covariance = R @ landmark.covariance @ R.T
