"""What the points of a thing say of its size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..map.thing import Thing
from .instance_config import InstanceConfig


@dataclass(frozen=True, slots=True, eq=False)
class SizeCheck:
    """A thing's volume beside its segment, along the box's own axes, the third being up; (3,) arrays, metres.

    Attributes:
        volume: the size of its volume.
        extent: of its segment.
        disagrees: bool, where they differ by more than they may.
        estimate: the size from both where any of them disagrees, else None; axes that agree keep the volume's.
        std: standard deviations of `estimate`.
    """

    volume: np.ndarray
    extent: np.ndarray
    disagrees: np.ndarray
    estimate: np.ndarray | None
    std: np.ndarray | None


def check_size(local: np.ndarray, thing: Thing, voxel: float, config: InstanceConfig) -> SizeCheck | None:
    """Compare a thing's size with the extent of its points; None where they are too few.

    A size S of standard deviation s and an extent E of standard deviation e that disagree are both believed less:

        size = (S / s^2 + E / e^2) / (1 / s^2 + 1 / e^2),   std = |S - E| / sqrt(s^2 + e^2) / sqrt(1 / s^2 + 1 / e^2)

    which is the weighted mean, its standard deviation grown by the square root of chi^2 of the two (Birge's ratio), not
    below 1. An extent is off by a voxel; where it falls short of the size, half of what is missing may be a side that
    no camera saw.

    Args:
        local: (M, 3) points along the box's axes, metres, from any origin.
        thing: whose they are.
        voxel: metres, the edge of a voxel, which every point stands for.
        config: numbers.
    """
    if len(local) < config.compared_from:
        return None
    low, high = np.percentile(local, [config.extent, 100.0 - config.extent], axis=0)
    extent, size = high - low, thing.size
    allowed = thing.size_std + np.maximum(config.share * size, config.excess)
    disagrees = np.abs(extent - size) > allowed
    if not disagrees.any():
        return SizeCheck(size, extent, disagrees, None, None)
    variance = np.maximum(thing.size_std, voxel / np.sqrt(12.0)) ** 2  # no size is known better than a voxel
    other = voxel**2 + (np.maximum(size - extent, 0.0) / 2.0) ** 2
    weight = variance / (variance + other)
    strain = np.maximum(np.abs(extent - size) / np.sqrt(variance + other), 1.0)
    std = strain * np.sqrt(variance * other / (variance + other))
    estimate = np.where(disagrees, size + weight * (extent - size), size)
    return SizeCheck(size, extent, disagrees, estimate, np.where(disagrees, std, thing.size_std))
