"""Truth of TUM RGB-D recordings: trajectories, and the cuboid of the keyframes distributed with cuboid SLAM.

groundtruth.txt                     rows `stamp tx ty tz qx qy qz qw` (see `poses`)
benchun_gt/truth_objects.txt        rows `x y z yaw hx hy hz`: centre, radians about z, half extents
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from .errors import InputError
from .ground_truth import GroundTruth
from .poses import read_tum_poses
from .tables import read_table
from .truth import TrueObject

CUBOIDS = Path("benchun_gt") / "truth_objects.txt"
CUBOID_COLUMNS = "x y z yaw hx hy hz"
# The file has no classes. It is distributed for fr3_cabinet alone, which shows one cabinet in an empty hall.
CUBOID_CLASS = "cabinet"
CUBOID_TOLERANCE = 0.03  # metres; the cuboid agrees with the depth images of all keyframes to 1 to 3 cm


def truth_of_trajectory(path: Path) -> GroundTruth:
    """Poses at the stamps of the file's rows; raises `InputError` where it is wrong or has no pose."""
    trajectory = read_tum_poses(path)
    if len(trajectory.stamps) == 0:
        raise InputError(path, "rows `stamp tx ty tz qx qy qz qw`", "no pose", "check that the file is complete")
    return GroundTruth(
        name=path.resolve().stem,
        classes=(),
        complete=False,
        stamps=trajectory.stamps,
        poses=trajectory.matrices,
    )


def with_cuboids(truth: GroundTruth, path: Path) -> GroundTruth:
    """Truth of the keyframes' poses with the cuboids of a file.

    Raises:
        InputError: it is not as above.
    """
    rows = read_table(path, CUBOID_COLUMNS)
    if len(rows) == 0 or not np.isfinite(rows).all() or (rows[:, 4:] <= 0.0).any():
        found = "no row" if len(rows) == 0 else "a row with another value"
        remedy = "correct the file"
        raise InputError(path, f"rows of `{CUBOID_COLUMNS}`, metres and radians, extents > 0", found, remedy)
    objects = tuple(TrueObject(k, CUBOID_CLASS, row[:3], 2.0 * row[4:], float(row[3])) for k, row in enumerate(rows))
    tolerance = dict.fromkeys(range(len(objects)), CUBOID_TOLERANCE)
    return replace(truth, classes=(CUBOID_CLASS,), objects=objects, tolerance=tolerance, complete=True)
