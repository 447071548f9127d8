"""Places as they are written on the command line: regions and camera poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...datasets.errors import UserError
from ..map.polygon import Polygon
from ..map.region import Ball, Box


def box_of(values: tuple[float, ...]) -> Box:
    """From two corners, six numbers in metres, in any order of low and high; map frame."""
    corners = np.array(values, dtype=np.float64).reshape(2, 3)
    return Box(corners.min(axis=0), corners.max(axis=0))


def ball_of(values: tuple[float, ...]) -> Ball:
    """From a centre and a radius, four numbers in metres; map frame."""
    if not values[3] >= 0.0:
        raise UserError(f"--within-ball: expected a radius of at least 0 metres, found {values[3]:g}")
    return Ball(np.array(values[:3], dtype=np.float64), float(values[3]))


def polygon_of(text: str, heights: tuple[float, float] | None) -> Polygon:
    """From "x,y x,y x,y", metres in the upright frame, and the heights between which it stands."""
    try:
        corners = [[float(value) for value in corner.split(",")] for corner in text.split()]
        return Polygon(np.array(corners, dtype=np.float64), *(heights or (-np.inf, np.inf)))
    except ValueError as error:
        raise UserError(
            f'--within-polygon: expected at least three corners "x,y x,y x,y", found {text!r}: {error}'
        ) from None


def pose_of(text: str, out: Path, option: str) -> np.ndarray:
    """(4, 4) `T_world_camera` from "tx ty tz qx qy qz qw", or from a stamp of the run's trajectory, seconds.

    Raises:
        UserError: it is neither; the run has no pose at that stamp, or no trajectory beside its map.
    """
    from ...datasets.poses import nearest_rotations, pose_matrices

    try:
        values = np.array([float(word) for word in text.replace(",", " ").split()])
    except ValueError:
        values = np.zeros(0)
    if values.shape == (1,) and np.isfinite(values[0]):
        return _pose_at(float(values[0]), out, option)
    if values.shape != (7,) or not np.all(np.isfinite(values)) or not np.linalg.norm(values[3:]) > 1e-6:
        raise UserError(f'{option}: expected "tx ty tz qx qy qz qw" or a stamp in seconds, found {text!r}')
    quaternion = values[None, 3:] / np.linalg.norm(values[3:])
    poses, _ = nearest_rotations(pose_matrices(values[None, :3], quaternion))
    return poses[0]


def _pose_at(stamp: float, out: Path, option: str) -> np.ndarray:
    from ...datasets.poses import read_tum_poses

    file = (out if out.is_dir() else out.parent) / "trajectory.txt"
    if not file.is_file():
        raise UserError(f"{option}: {file} is not there, so a stamp says nothing; give a pose tx ty tz qx qy qz qw")
    path = read_tum_poses(file)
    pose = path.at(np.array([stamp]))[0]
    if not np.all(np.isfinite(pose)):
        first, last = (f"{path.stamps[k]:.3f}" for k in (0, -1)) if len(path.stamps) else ("none", "none")
        raise UserError(f"{option}: the trajectory has no pose at {stamp:g} s; its stamps go from {first} to {last}")
    return pose
