"""The numbers of fitting boxes to the points of things."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BoxConfig:
    """When points lie on a box, and where its faces are.

    Attributes:
        least_points: voxels of a thing, from which a box is looked for: 10 cm x 10 cm of its surface, at 1 cm.
        most_points: voxels that turns are tried with; they say as much as all of them.
        step: radians between the turns that are tried.
        outside: percentile of points, beyond which none is taken for a part of the thing.
        far: metres of distance from a side, and
        far_share: of the rectangle's sides, of which the greater is where a distance stops to count.
        round_from: `SegmentBox.roundness` from which on a thing is round, or nobody knows how it stands.
        face: metres, half the thickness of what is one face: noise of depth and poses.
        reach: metres behind the outermost points, and
        reach_share: of a side, of which the greater is how deep a face is looked for, up to a third of the side.
        denser: times as dense as in the middle of the box points must be, to be a face.
        seen: share of a face that must hold points, for its ends to be known.
    """

    least_points: int = 100
    most_points: int = 3000
    step: float = 0.0174533
    outside: float = 1.0
    far: float = 0.03
    far_share: float = 0.1
    round_from: float = 0.8
    face: float = 0.015
    reach: float = 0.03
    reach_share: float = 0.15
    denser: float = 2.0
    seen: float = 0.6
