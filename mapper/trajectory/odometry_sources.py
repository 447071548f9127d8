"""The odometry that a configuration names."""

from __future__ import annotations

from ..config import OdometryConfig, OdometrySource
from .given_odometry import PoseOdometry
from .kiss_odometry import KissOdometry
from .odometry import Odometry


def make_odometry(config: OdometryConfig) -> Odometry:
    """The odometry that the configuration names, fresh."""
    return PoseOdometry(config) if config.source is OdometrySource.POSES else KissOdometry(config)
