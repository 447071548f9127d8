"""Camera poses for tools that compare trajectories, such as evo: TUM's and KITTI's text files.

Poses are `T_world_camera` in the map's frame (`map.json` names it), metres, OpenCV camera axes. TUM's lines carry their
stamps; KITTI's do not: line i is the i-th frame that was mapped, or the i-th keyframe.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from ...datasets.errors import InputError
from ..map.atomic import write_atomic
from ..map.store import AGAIN, OutputFolder
from ..map.trajectory_file import HEADER
from .rotations import quaternions


def export_tum(folder: OutputFolder, file: Path, *, keyframes: bool = False) -> int:
    """Write lines `stamp tx ty tz qx qy qz qw`, of keyframes only where asked; returns the number of poses."""
    stamps, poses = read_poses(folder, keyframes)
    rows = np.column_stack([stamps, poses[:, :3, 3], quaternions(poses[:, :3, :3])])
    _write(file, rows, ["%.9f"] * 8, HEADER)
    return len(rows)


def export_kitti(folder: OutputFolder, file: Path, *, keyframes: bool = False) -> int:
    """Write the upper three rows of each pose as a line of 12 numbers; returns the number of poses."""
    poses = read_poses(folder, keyframes)[1]
    _write(file, poses[:, :3].reshape(-1, 12), ["%.9e"] * 12)
    return len(poses)


def read_poses(folder: OutputFolder, keyframes: bool) -> tuple[np.ndarray, np.ndarray]:
    """(N,) stamps and (N, 4, 4) `T_world_camera` of all mapped frames, or of the keyframes.

    Raises:
        InputError: the file of either is absent or damaged.
    """
    if not keyframes:
        return folder.read_trajectory()
    from ..evaluation.inputs.load_run import load_run

    found = load_run(folder.path).keyframes
    if found is None:
        raise InputError(folder.keyframes_file, "poses of keyframes", "no such file", AGAIN)
    return found.stamps, found.poses


def _write(file: Path, rows: np.ndarray, formats: list[str], header: str = "") -> None:
    text = io.StringIO()
    np.savetxt(text, rows, fmt=formats, header=header)
    write_atomic(file, text.getvalue().encode())
