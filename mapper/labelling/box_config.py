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
        round_from: `SegmentBox.roundness` from which on a thing is round, or nobody knows how it stands: on 13 training
            tables cereal boxes and lying flashlights had up to 0.68, bowls, mugs and cans from 0.73.
        face: metres, half the thickness of what is one face: noise of depth and poses.
        reach: metres behind the outermost points, and
        reach_share: of a side, of which the greater is how deep a face is looked for, up to a third of the side.
        denser: times as dense as in the middle of the box points must be, to be a face.
        seen: share of a face that must hold points, for its ends to be known.
        shrink: of the volume's room, the least that a box of its points may take: less is a piece of the thing.
        grow: the most: more is the thing and what stands beside it.
    """

    least_points: int = 100
    most_points: int = 3000
    step: float = 0.0174533
    outside: float = 1.0
    far: float = 0.03
    far_share: float = 0.1
    round_from: float = 0.7
    face: float = 0.015
    reach: float = 0.03
    reach_share: float = 0.15
    denser: float = 2.0
    seen: float = 0.6
    shrink: float = 0.2
    grow: float = 1.5
