"""The numbers of telling things apart among labelled voxels, and of comparing them with their volumes."""

from __future__ import annotations

from dataclasses import dataclass

from ...datasets.errors import UserError


@dataclass(frozen=True, slots=True)
class InstanceConfig:
    """When a thing owns voxels, and when its size is in doubt.

    Attributes:
        least_belief: that a thing exists and is of a segment's class, for the segment to be its own: a thing that is
            probably a bowl and maybe a cup owns what is labelled as a cup.
        least_points: voxels in the thing's volume from which on a segment may be its own; fewer come from a neighbour
            that it touches.
        margin: standard deviations of a volume's sides, by which it is grown for that.
        reach: share of a volume's longest side, beyond its sides, up to which voxels of its segment are its own. A
            volume of less than half the true size is another thing's, or wrong in more than its size.
        compared_from: voxels of a thing from which on its size is compared: 7 cm x 7 cm of a surface, at 1 cm. Fewer
            are a part of it, whose extent says little: of 190 things of training tables 23 disagreed with their points,
            three of them with 10 to 16, and most of the sides that those changed got worse.
        extent: percentile, and 100 - extent the other, between which a segment's extent is measured: a few stray voxels
            do not count.
        share: of a size, and
        excess: metres, of which the greater is what a size and its segment's extent may differ by beyond the size's
            standard deviation; 2 cm are two voxels.

    Raises:
        UserError: for a value out of range.
    """

    least_belief: float = 0.1
    least_points: int = 5
    margin: float = 1.0
    reach: float = 0.5
    compared_from: int = 50
    extent: float = 2.0
    share: float = 0.25
    excess: float = 0.02

    def __post_init__(self) -> None:
        if not (0.0 < self.least_belief <= 1.0 and 0.0 <= self.extent < 50.0):
            raise UserError(f"expected least_belief in (0, 1] and extent in [0, 50), but got {self}")
        if min(self.least_points, self.compared_from) < 1 or min(self.margin, self.reach, self.share, self.excess) < 0:
            raise UserError(f"expected counts of at least 1 and no negative number, but got {self}")
