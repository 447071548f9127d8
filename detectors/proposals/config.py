"""The numbers that proposals are made by."""

from __future__ import annotations

from dataclasses import dataclass

DEPTH_SIGMA = 1.425e-3
"""1 / metre: a structured-light camera's depth z has the standard deviation DEPTH_SIGMA z^2.

Khoshelham and Elberink, Accuracy and Resolution of Kinect Depth Data, Sensors 12, 2012.
"""


@dataclass(frozen=True, slots=True)
class PlaneConfig:
    """Which surfaces are large planes.

    Attributes:
        cell: points of the grid, side of the squares that planes are grown from.
        cell_fill: least share of a square's points that have a depth.
        joining_angle: radians between the normals of a square and of the plane it joins.
        min_horizontal: m^2 seen of a horizontal plane that supports things; less may be a thing's own top.
        min_lowest: m^2, the same where no larger horizontal plane is up to `stack` metres below it: a shelf.
        stack: see there.
        min_other: m^2 seen of any other plane, wall or front; less is a face of a thing.
        horizontal_angle: radians from up within which a plane's normal is called horizontal.
        hand_angle: radians; without a measured up, a plane turned towards the camera whose normal is within this of
            the image's up may be a floor or a table. Hand-held cameras look down by up to about 55 degrees.
        reach: points of the grid around the squares of a plane within which its points are looked for.
        point_angle: radians between the normals of a plane and of a point on it.
        tolerance: metres that a point may be off the plane, to which `sigmas` times the depth noise is added.
        sigmas: see there.
        rms: metres that the points of two pieces scatter about a common plane, to which `rms_sigmas` times the depth
            noise is added; more, and they are two planes.
        rms_sigmas: see there.

    The values are own choices, tried on rendered tabletops of seeds below 1000 and looked at in recorded images.
    """

    cell: int = 8
    cell_fill: float = 0.6
    joining_angle: float = 0.2
    min_horizontal: float = 0.1
    min_lowest: float = 0.03
    stack: float = 0.5
    min_other: float = 0.25
    horizontal_angle: float = 0.26
    hand_angle: float = 1.05
    reach: int = 8
    point_angle: float = 0.9
    tolerance: float = 0.005
    sigmas: float = 1.5
    rms: float = 0.002
    rms_sigmas: float = 1.5


@dataclass(frozen=True, slots=True)
class ProposalConfig:
    """How the points that are on no large plane become proposals.

    Attributes:
        columns: about how many points the grid has along the image's width, one for each square of pixels.
        near: metres, and
        far: metres; depths outside are left out.
        planes: which surfaces are removed.
        radius_per_depth: of mean shift, metres a metre of median plane depth (the paper scales it so, without saying
            by what).
        min_radius: metres, and
        max_radius: metres, between which it is kept.
        height_share: distances along up count so much as others: things that stand are taller than wide.
        voxels_per_radius: points are binned into voxels of radius / this.
        jump_share: neighbouring points whose depths differ by this share and `jump` metres are of two things.
        jump: see there.
        min_piece: points of a piece of a cluster; smaller ones are dropped.
        least_fold: radians; neighbouring pieces are parts of one thing where the surface between them folds less
            towards the camera.
        least_contact: neighbouring points over the square root of the smaller piece's, for that.
        max_joined: metres, most of the box of what is so joined.
        min_points: of the point grid that a proposal has.
        min_extent: metres, least of the second largest extent of a proposal.
        max_extent: metres, most of the largest.
    """

    columns: int = 320
    near: float = 0.2
    far: float = 4.0
    planes: PlaneConfig = PlaneConfig()
    radius_per_depth: float = 0.035
    min_radius: float = 0.03
    max_radius: float = 0.25
    height_share: float = 0.5
    voxels_per_radius: int = 4
    jump_share: float = 0.008
    jump: float = 0.006
    min_piece: int = 12
    least_fold: float = -0.35
    least_contact: float = 0.3
    max_joined: float = 0.3
    min_points: int = 60
    min_extent: float = 0.015
    max_extent: float = 1.5

    def step(self, width: int) -> int:
        """Pixels of an image of that width from point to point of the grid."""
        return max(1, round(width / self.columns))
