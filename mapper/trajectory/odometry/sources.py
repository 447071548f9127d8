"""The odometry that a configuration names, and the source that a word on the command line names."""

from __future__ import annotations

import difflib
from dataclasses import replace
from pathlib import Path

from ....datasets.errors import UserError
from ...config import OdometryConfig, OdometrySource
from .gicp_odometry import GicpOdometry
from .given_odometry import PoseOdometry, TrajectoryOdometry
from .kiss_odometry import KissOdometry
from .lidar_odometry import LidarOdometry
from .odometry import Odometry

_ODOMETRIES = {
    OdometrySource.KISS_ICP: KissOdometry,
    OdometrySource.SMALL_GICP: GicpOdometry,
    OdometrySource.POSES: PoseOdometry,
    OdometrySource.FILE: TrajectoryOdometry,
}
WORDS = tuple(source.value for source in OdometrySource if source is not OdometrySource.FILE)


def make_odometry(config: OdometryConfig, has_scan: bool = False) -> Odometry:
    """The odometry that the configuration names, fresh; KISS-ICP takes the scans of a LiDAR with numbers of their own.

    Raises:
        InputError: it names a trajectory file that cannot be read.
        UserError: it registers depth images only, and there are scans.
    """
    if has_scan and config.source is OdometrySource.SMALL_GICP:
        raise UserError(f"odometry {config.source.value} is for depth cameras; use kiss-icp for a LiDAR")
    if has_scan and config.source is OdometrySource.KISS_ICP:
        return LidarOdometry(config)
    return _ODOMETRIES[config.source](config)


def with_source(config: OdometryConfig, choice: str) -> OdometryConfig:
    """The configuration with the source that `choice` says: one of `WORDS`, or the path of a trajectory file.

    Raises:
        UserError: it is neither.
    """
    if choice in WORDS:
        return replace(config, source=OdometrySource(choice), path="")
    if Path(choice).is_file():
        return replace(config, source=OdometrySource.FILE, path=choice)
    near = difflib.get_close_matches(choice.lower(), WORDS, n=1)
    hint = f"; did you mean {near[0]}?" if near else ""
    expected = f"{', '.join(WORDS)} or a file with rows `stamp tx ty tz qx qy qz qw`"
    raise UserError(f"--odometry {choice}: expected {expected}, found no such file{hint}")
