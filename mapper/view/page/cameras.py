"""Where the camera was: the path, and the poses of the views that a page can show."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ....datasets.errors import InputError
from ....datasets.stamps import nearest
from ...map.store import OutputFolder

SAME = 1e-5  # s: stamps this near are one frame; files of trajectories hold microseconds
PATH_POINTS = 4000  # of the line that is drawn


@dataclass(eq=False)
class Cameras:
    """The poses of a run, and a numbered list of those that the page names.

    Attributes:
        stamps: (N,) seconds, rising.
        poses: (N, 4, 4) `T_world_camera`, map frame.
        keyframes: (M,) indices of keyframes in the two.
        used: index of a pose -> its number on the page; grows as poses are asked for.
    """

    stamps: np.ndarray
    poses: np.ndarray
    keyframes: np.ndarray
    used: dict[int, int] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: OutputFolder) -> Cameras:
        """Of a run; empty where the folder has no trajectory.

        Raises:
            InputError: a file is damaged.
        """
        if not folder.trajectory_file.is_file():
            return cls(np.empty(0), np.empty((0, 4, 4)), np.empty(0, dtype=np.intp))
        stamps, poses = folder.read_trajectory()
        order = np.argsort(stamps, kind="stable")
        stamps, poses = stamps[order], poses[order]
        cameras = cls(stamps, poses, np.empty(0, dtype=np.intp))
        if folder.keyframes_file.is_file():
            places = nearest(_keyframe_stamps(folder), stamps, SAME)
            cameras.keyframes = np.unique(places[places >= 0])
        for place in cameras.keyframes.tolist():
            cameras.number(place)
        return cameras

    @property
    def positions(self) -> np.ndarray:
        """(N, 3) metres, map frame."""
        return self.poses[:, :3, 3]

    def at(self, stamp: float) -> int | None:
        """The pose of a frame, by its stamp."""
        place = int(nearest(np.array([stamp]), self.stamps, SAME)[0])
        return place if place >= 0 else None

    def number(self, place: int) -> int:
        """The page's number of a pose; it will be on the page."""
        return self.used.setdefault(place, len(self.used))

    def to_page(self, R_world_upright: np.ndarray) -> dict:
        """Plain values: the line of the path, the poses that were numbered, how many of them are keyframes.

        Metres, upright frame; a pose is its position and then `R_upright_camera` row by row.
        """
        step = max(1, -(-len(self.stamps) // PATH_POINTS))
        path = self.positions[::step] @ R_world_upright
        places = list(self.used)
        turned = R_world_upright.T @ self.poses[places, :3, :3]
        rows = np.concatenate([self.positions[places] @ R_world_upright, turned.reshape(-1, 9)], axis=1)
        return {
            "path": np.round(path, 4).ravel().tolist(),
            "poses": np.round(rows, 4).tolist(),
            "stamps": np.round(self.stamps[places], 6).tolist(),
            "keyframes": len(self.keyframes),
            "frames": len(self.stamps),
        }


def _keyframe_stamps(folder: OutputFolder) -> np.ndarray:
    try:
        with np.load(folder.keyframes_file, allow_pickle=False) as file:
            return np.asarray(file["stamps"], dtype=np.float64)
    except (OSError, ValueError, KeyError, EOFError) as error:
        again = "write it again with `thingmap run`"
        raise InputError(folder.keyframes_file, "poses of keyframes", str(error), again) from None
