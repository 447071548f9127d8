"""The graph, and birth and death of landmarks."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SmootherConfig:
    """ISAM2; thresholds measured with 1000 keyframes and 100 objects (benchmarks/throughput.py)."""

    relinearize_skip: int = 10  # updates
    threshold_rotation: float = 0.02  # rad
    threshold_translation: float = 0.1  # m
    threshold_position: float = 0.1  # m
    threshold_size: float = 0.1  # log units
    threshold_up: float = 0.02  # rad
    guard_position: float = 10.0  # m, weak permanent prior on positions
    guard_size: float = 1.5  # log units, weak permanent prior on sizes
    robust_odometry: bool = False
    joint: bool = True  # off: objects do not move cameras; each is estimated by itself from poses taken as exact


@dataclass(frozen=True, slots=True)
class LifecycleConfig:
    """Merging and retirement."""

    merge_gate: float = 16.81  # chi-square, 6 degrees of freedom, 99 %: two positions (joint covariance) and sizes
    merge_log_size: float = 0.35  # log units, boxes of one object differ this much with what of it was visible
    merge_overlap: float = 0.15  # intersection over the smaller volume that makes two things one
    merge_every: int = 5  # keyframes
    merge_extent: float = 0.5  # of the mean half axis: a partly seen object's centre is this uncertain
    retire_below: float = 0.02  # existence
    retire_views: float = 3.0  # effective views before a landmark can be retired


@dataclass(frozen=True, slots=True)
class CorrectionConfig:
    """When poses count as corrected; what the graph moves them by otherwise is within the noise of their depth."""

    translation: float = 0.01  # m
    rotation: float = 0.005  # rad (0.3 degrees)
