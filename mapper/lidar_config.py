"""The mapper's numbers for a LiDAR on a vehicle, where those of `config.py` are for a depth camera in a room."""

from __future__ import annotations

from dataclasses import replace

from ..datasets.lidar_sequence import is_lidar
from ..datasets.sequence import Sequence
from .config import MapperConfig


def default_config(sequence: Sequence) -> MapperConfig:
    """The configuration to start from for a sequence, by what its frames are."""
    return lidar_defaults() if is_lidar(sequence) else MapperConfig()


def lidar_defaults() -> MapperConfig:
    """Numbers for tens of metres; what is not named here is as in `MapperConfig`."""
    c = MapperConfig()
    return replace(
        c,
        visual=replace(c.visual, enabled=False),  # features' depth would be that of points a few pixels away
        # 1 m is every frame at 36 km/h and 10 Hz; 1 s
        keyframes=replace(c.keyframes, translation=1.0, rotation=0.17, max_gap=10),
        lifting=replace(
            c.lifting,
            max_range=50.0,  # m; with 64 lines a car at 50 m has three of them
            noise_floor=0.02,  # m, a Velodyne's at any range
            sensor_noise=1e-5,  # m at 1 m, growing with z^2: 2.5 cm at 50 m
        ),
        association=replace(c.association, position_floor=0.1),  # m
        tracks=replace(c.tracks, process_sigma=0.03),  # m per keyframe
        cloud=replace(c.cloud, voxel_size=0.2, max_range=50.0),  # m
        multiview=replace(c.multiview, far=50.0),  # m
    )
