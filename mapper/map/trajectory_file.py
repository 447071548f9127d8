"""Trajectories as text in the format of the TUM benchmark, a line for every frame: `stamp tx ty tz qx qy qz qw`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...datasets.errors import InputError
from .atomic import replacing
from .cloud_file import AGAIN

HEADER = "stamp tx ty tz qx qy qz qw: T_world_camera in seconds and metres"
FORMATS = ["%.6f"] + ["%.6f"] * 3 + ["%.8f"] * 4  # microseconds, micrometres


def write_trajectory(file: Path, stamps: np.ndarray, T_world_camera: np.ndarray) -> None:
    """(N,) seconds and (N, 4, 4) poses; quaternions have qw >= 0."""
    from scipy.spatial.transform import Rotation

    poses = np.asarray(T_world_camera, dtype=np.float64).reshape(-1, 4, 4)
    quaternions = np.empty((0, 4))
    if len(poses):
        quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat(canonical=True)
    rows = np.column_stack([np.asarray(stamps, dtype=np.float64), poses[:, :3, 3], quaternions])
    with replacing(file) as temporary:
        np.savetxt(temporary, rows, fmt=FORMATS, header=HEADER)


def read_trajectory(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """(N,) stamps in seconds and (N, 4, 4) `T_world_camera`; raises `InputError` where the file is no trajectory."""
    from scipy.spatial.transform import Rotation

    try:
        lines = file.read_text(encoding="utf-8").splitlines()
        fields = [line.split() for line in lines if line.strip() and line[0] != "#"]
        if wrong := [row for row in fields if len(row) != 8]:
            raise ValueError(f"a line of {len(wrong[0])}")
        rows = np.array(fields, dtype=np.float64).reshape(-1, 8)
    except (OSError, ValueError) as error:
        raise InputError(file, "lines of 8 numbers", str(error), AGAIN) from None
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    if len(rows):
        poses[:, :3, :3] = Rotation.from_quat(rows[:, 4:]).as_matrix()
    poses[:, :3, 3] = rows[:, 1:4]
    return rows[:, 0], poses
