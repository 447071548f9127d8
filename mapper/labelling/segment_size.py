"""What the points of a thing say of its size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..map.thing import Thing
from .box_config import BoxConfig
from .instance_config import InstanceConfig
from .segment_box import SegmentBox


@dataclass(frozen=True, slots=True, eq=False)
class SizeCheck:
    """A thing's volume beside its segment, along the box's own axes, the third being up; (3,) arrays, metres.

    Attributes:
        volume: the size of its volume.
        extent: of its segment.
        disagrees: bool, where they differ by more than they may.
        estimate: the size from both where any of them disagrees, else None; axes that agree keep the volume's. Of a
            thing that is a box, the box's.
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


def check_box(box: SegmentBox, thing: Thing, config: InstanceConfig, limits: BoxConfig) -> SizeCheck | None:
    """Compare a thing's volume with the box that its points lie on, along that box's axes; None where the box is not
    the thing's: a piece of it, it and its neighbour, or seen from too few sides.

    Faces are where they were seen, and a volume is an upright cylinder about the detector's boxes, so that the size of
    a box is believed as it is. The volume's extent along axes turned by a is 2 hypot(w cos a, d sin a) / 2.
    """
    if not box.known.all():
        return None
    cosine, sine = np.cos(box.yaw - thing.yaw), np.sin(box.yaw - thing.yaw)
    turn = np.array([[cosine, sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    volume = np.sqrt(turn**2 @ thing.size**2)
    share = float(np.prod(box.size) / max(np.prod(thing.size), 1e-9))
    if not limits.shrink <= share <= limits.grow:
        return None
    std = np.sqrt(turn**2 @ thing.size_std**2)
    disagrees = np.abs(box.size - volume) > std + np.maximum(config.share * volume, config.excess)
    return SizeCheck(volume, box.size, disagrees, box.size, box.std)
