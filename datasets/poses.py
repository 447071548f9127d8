"""Camera poses in text files: parsing, validation, and the pose at a stamp.

Every pose is `T_world_camera`, metres, OpenCV camera axes. Poses are checked and their rotations projected back on
SO(3) here, once, because `gtsam.Rot3` ends the interpreter on a matrix that is not a rotation.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import InputError
from .stamps import nearest
from .tables import read_table

# Files round their numbers (TUM: 4 decimals, so 1e-4); a wrong column order or a scaled matrix is off by far more.
MAX_ROTATION_ERROR = 0.01
# Motion capture runs at 100 Hz: a longer gap between two rows is a loss of tracking, not to be bridged.
MAX_INTERPOLATION_GAP = 0.1  # s
# The tolerance of the TUM benchmark's own tools.
MAX_STAMP_DIFFERENCE = 0.02  # s

TUM_COLUMNS = "stamp tx ty tz qx qy qz qw"
ROW_COLUMNS = "qw qx qy qz tx ty tz"


@dataclass(frozen=True, slots=True, eq=False)
class StampedPoses:
    """A trajectory sorted by stamp.

    Attributes:
        stamps: (N,) seconds.
        positions: (N, 3) metres, world frame.
        quaternions: (N, 4) unit, qx qy qz qw, camera to world.
    """

    stamps: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray

    @property
    def matrices(self) -> np.ndarray:
        """(N, 4, 4) `T_world_camera`."""
        return pose_matrices(self.positions, self.quaternions)

    def at(self, stamps: np.ndarray) -> np.ndarray:
        """(M,) seconds to (M, 4, 4) `T_world_camera`, NaN where the trajectory has no pose.

        Interpolated (position linearly, rotation spherically) between two rows at most `MAX_INTERPOLATION_GAP`
        apart; otherwise the nearest row within `MAX_STAMP_DIFFERENCE`; otherwise none.
        """
        poses = np.full((len(stamps), 4, 4), np.nan)
        if len(self.stamps) == 0:
            return poses
        after = np.searchsorted(self.stamps, stamps)
        low, high = np.clip(after - 1, 0, None), np.clip(after, None, len(self.stamps) - 1)
        gap = self.stamps[high] - self.stamps[low]
        between = (gap > 0) & (gap <= MAX_INTERPOLATION_GAP)
        fraction = np.where(between, (stamps - self.stamps[low]) / np.where(between, gap, 1.0), 0.0)
        closest = nearest(stamps, self.stamps, MAX_STAMP_DIFFERENCE)
        known = between | (closest >= 0)
        low, high = np.where(between, low, closest), np.where(between, high, closest)
        positions = self.positions[low] + fraction[:, None] * (self.positions[high] - self.positions[low])
        quaternions = _slerp(self.quaternions[low], self.quaternions[high], fraction)
        poses[known] = pose_matrices(positions[known], quaternions[known])
        return poses


def pose_matrices(positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
    """(N, 3) metres and (N, 4) unit quaternions qx qy qz qw to (N, 4, 4) poses."""
    x, y, z, w = quaternions.T
    poses = np.zeros((len(positions), 4, 4))
    poses[:, 0, 0], poses[:, 0, 1], poses[:, 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    poses[:, 1, 0], poses[:, 1, 1], poses[:, 1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    poses[:, 2, 0], poses[:, 2, 1], poses[:, 2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    poses[:, :3, 3], poses[:, 3, 3] = positions, 1.0
    return poses


def read_tum_poses(path: Path) -> StampedPoses:
    """Trajectory in the TUM format, rows `stamp tx ty tz qx qy qz qw`; rows that say "lost" are left out.

    A row says "lost" with NaN or with a quaternion of zeros. Rows may be in any order; of equal stamps the first
    counts.

    Raises:
        InputError: the file cannot be read, or a quaternion is not of unit length.
    """
    table = read_table(path, TUM_COLUMNS)
    positions, quaternions = _checked(path, TUM_COLUMNS, table[:, 1:4], table[:, 4:])
    known = np.flatnonzero(np.isfinite(table[:, 0]) & np.isfinite(quaternions[:, 0]))
    stamps, order = np.unique(table[known, 0], return_index=True)
    return StampedPoses(stamps, positions[known][order], quaternions[known][order])


def read_poses_at(path: Path, stamps: np.ndarray) -> np.ndarray | None:
    """(N, 4, 4) poses of a TUM-format file at (N,) stamps in seconds, as by `StampedPoses.at`; None without the file.

    Raises:
        InputError: the file is wrong, or it has a pose at none of the stamps.
    """
    if not path.is_file():
        return None
    trajectory = read_tum_poses(path)
    poses = trajectory.at(stamps)
    if np.isnan(poses[:, 0, 0]).all():
        of = trajectory.stamps
        found = f"stamps {of[0]:.6f} to {of[-1]:.6f}" if len(of) else "no pose"
        expected = f"poses within {MAX_STAMP_DIFFERENCE} s of the frames, {stamps[0]:.6f} to {stamps[-1]:.6f}"
        remedy = "give poses of this recording by the same clock in seconds, or remove the file"
        raise InputError(path, expected, found, remedy)
    return poses


def read_tum_pose_rows(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(N,) stamps as written and (N, 4, 4) poses of a TUM-format file in the order of its rows; NaN where "lost".

    For files whose rows belong to frames by their position, not by their stamp.

    Raises:
        InputError: the file cannot be read, or a quaternion is not of unit length.
    """
    table = read_table(path, TUM_COLUMNS)
    return table[:, 0], pose_matrices(*_checked(path, TUM_COLUMNS, table[:, 1:4], table[:, 4:]))


def read_pose_rows(path: Path) -> np.ndarray:
    """(N, 4, 4) poses of a file with rows `qw qx qy qz tx ty tz` (RGB-D Scenes v2); NaN where a row says "lost".

    Raises:
        InputError: the file cannot be read, or a quaternion is not of unit length.
    """
    table = read_table(path, ROW_COLUMNS)
    return pose_matrices(*_checked(path, ROW_COLUMNS, table[:, 4:], table[:, [1, 2, 3, 0]]))


def nearest_rotations(poses: np.ndarray) -> tuple[np.ndarray, dict[int, str]]:
    """(N, 4, 4) matrices from files to valid poses: the rotation part becomes the nearest rotation (by SVD).

    Returns:
        (N, 4, 4) poses, NaN where a matrix is no pose even within `MAX_ROTATION_ERROR`, and what is wrong with each of
        those, by row.
    """
    finite: np.ndarray = np.all(np.isfinite(poses), axis=(1, 2))
    valid = np.where(finite[:, None, None], poses, np.eye(4))
    rotations = valid[:, :3, :3]
    errors = np.abs(np.swapaxes(rotations, 1, 2) @ rotations - np.eye(3)).max(axis=(1, 2))
    reflected = np.linalg.det(rotations) < 0
    affine = np.abs(valid[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1) <= 1e-6
    problems: dict[int, str] = {}
    for i in np.flatnonzero(~finite | ~affine | (errors > MAX_ROTATION_ERROR) | reflected):
        if not finite[i]:
            problems[int(i)] = "the pose is not finite"
        elif not affine[i]:
            problems[int(i)] = f"the last row of the pose is {valid[i, 3].tolist()}, not 0 0 0 1"
        elif errors[i] > MAX_ROTATION_ERROR:
            problems[int(i)] = f"the rotation of the pose is off orthonormal by {errors[i]:.2g}"
        else:
            problems[int(i)] = "the rotation of the pose is a reflection"
    u, _, vt = np.linalg.svd(rotations)
    valid[:, :3, :3] = u @ vt
    valid[:, 3] = [0.0, 0.0, 0.0, 1.0]
    valid[list(problems)] = np.nan
    return valid, problems


def _checked(path: Path, columns: str, positions: np.ndarray, quaternions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rows with quaternions of length one; both NaN where a row says "lost"."""
    norm = np.linalg.norm(quaternions, axis=1)
    lost = np.logical_or(~np.isfinite(np.c_[positions, quaternions]).all(axis=1), norm == 0)
    wrong = np.flatnonzero(np.logical_and(~lost, np.abs(norm - 1) > MAX_ROTATION_ERROR))
    if len(wrong):
        found = f"a quaternion of length {norm[wrong[0]]:.3g} in pose {wrong[0] + 1}"
        raise InputError(
            path, f"rows of `{columns}` with unit quaternions", found, "check the order of the columns and the row"
        )
    norm = np.where(lost, np.nan, norm)
    return np.where(lost[:, None], np.nan, positions), quaternions / norm[:, None]


def _slerp(a: np.ndarray, b: np.ndarray, fraction: np.ndarray) -> np.ndarray:
    """(N, 4) unit quaternions, the way along the shorter arc from `a` to `b`."""
    cosine = np.sum(a * b, axis=1)
    b = np.where(cosine[:, None] < 0, -b, b)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-6
    divisor = np.where(near, 1.0, sine)
    weight_a = np.where(near, 1 - fraction, np.sin((1 - fraction) * angle) / divisor)
    weight_b = np.where(near, fraction, np.sin(fraction * angle) / divisor)
    q = weight_a[:, None] * a + weight_b[:, None] * b
    return q / np.linalg.norm(q, axis=1, keepdims=True)
