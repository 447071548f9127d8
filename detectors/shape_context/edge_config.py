"""The numbers that edges are found by."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..proposals.config import DEPTH_SIGMA


@dataclass(frozen=True, slots=True)
class DepthEdgeConfig:
    """Which steps of depth are edges.

    Steps are in 1 / metre: the inverse depth of a structured-light camera has one noise, DEPTH_SIGMA, at all distances.
    A step of 0.014 is 1.4 cm at 1 m and 6 cm at 2 m.

    Attributes:
        sigma: pixels, of the Gaussian whose derivative measures the step; rims waver by about a pixel.
        low: 1 / metre, least step of a point that continues an edge. Disparities come in steps of an eighth of a
            pixel, 0.0032 / m: contours of equal disparity have to stay below.
        high: 1 / metre, step that an edge has somewhere.
        slant_reach: pixels to both sides of a point at which the slant of the surfaces is taken, which is no step.
        unevenness: share of the slant by which a step is counted smaller: surfaces seen at a grazing angle are read
            more noisily (Nguyen et al., Modeling Kinect Sensor Noise, 3DIMPVT 2012), glossy ones in waves.
        bridge: 1 / metre; surfaces beside a hole that meet within this are one.
        max_slant: 1 / metre and pixel; more is not believed of a surface beside a hole. A plane 0.4 m from the camera,
            seen edge-on, has 1 / (0.4 f).
        slant_base: pixels, length over which the slant beside a hole is taken.
        near_reading: pixels; edges farther from all readings were made by filling holes.
        min_length: pixels; shorter edges are left out.

    The values are own choices, tried on rendered scenes of seeds below 1000 and looked at in recorded images.
    """

    sigma: float = 1.5
    low: float = 5 * DEPTH_SIGMA
    high: float = 10 * DEPTH_SIGMA
    slant_reach: int = 5
    unevenness: float = 0.5
    bridge: float = 8 * DEPTH_SIGMA
    max_slant: float = 0.005
    slant_base: int = 6
    near_reading: int = 2
    min_length: int = 8


@dataclass(frozen=True, slots=True)
class BoundaryConfig:
    """Which differences of colour are boundaries.

    Attributes:
        radii: pixels, of the half-discs, finest first, even numbers: they are laid on an image of half the size.
        texture: CIE Lab; within half-discs whose colours scatter by this much a difference counts 1 / sqrt(2).
        low: CIE Lab, least contrast of a point that continues a boundary.
        high: CIE Lab, contrast that a boundary has somewhere.
        min_length: pixels; shorter boundaries are left out.

    The values are own choices, tried as those of depth.

    Raises:
        ValueError: the radii are not even, growing numbers from 2.
    """

    radii: tuple[int, ...] = (4, 8, 12)
    texture: float = 8.0
    low: float = 6.0
    high: float = 15.0
    min_length: int = 10

    def __post_init__(self) -> None:
        radii = self.radii
        if not radii or radii[0] < 2 or any(r % 2 for r in radii) or list(radii) != sorted(set(radii)):
            raise ValueError(f"radii must be even, growing numbers from 2, but are {radii}")


@dataclass(frozen=True, slots=True)
class EdgeConfig:
    """Everything together, and how both kinds of edge are put into one map.

    Attributes:
        depth: edges of depth.
        boundaries: edges of colour.
        merging: pixels; an edge of colour this near to one of depth is the same contour, and left out.
        nearest: pixels, half side of the window whose nearest surface a point belongs to.
        margin: pixels around the asked-for part of the image that are left in points.
    """

    depth: DepthEdgeConfig = field(default_factory=DepthEdgeConfig)
    boundaries: BoundaryConfig = field(default_factory=BoundaryConfig)
    merging: int = 2
    nearest: int = 2
    margin: int = 2
