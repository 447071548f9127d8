"""The numbers of the Markov random field over voxels (Lai et al., section III-B and IV-A)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from ...datasets.errors import UserError


class Smoothness(StrEnum):
    """What it costs that neighbouring voxels differ in label."""

    NORMALS = "normals"  # little where the surface bends inwards, much on smooth and convex ones, equation (10)
    COLOUR = "colour"  # less the more their colours differ, equation (9)
    POTTS = "potts"  # always the same, equation (8)
    NONE = "none"  # nothing: the data term alone


@dataclass(frozen=True, slots=True)
class MrfConfig:
    """The pairwise term, and how hard is looked for the least energy.

    Measured on six rendered tabletops (seeds 1 to 3) with simulated detections: macro F of points without things'
    volumes as evidence / with them.

    Attributes:
        smoothness: which pairwise term.
        looks: for how many looks at a voxel its data term stands; all lambdas are divided by it. Equation (7) is a
            mean, so that all points in many frames count as one look. Then a can or a mug has 300 to 600 nats in favour
            of it, and its border, 110 to 180 pairs of voxels, costs 2600 to 4200 with lambda = 100: objects become
            background, 0.23 / 0.54. On twelve tables (seeds 41 to 44) 0.952 / 0.960 with 33 looks, 0.950 / 0.953 with
            50, 0.946 / 0.949 with 75, 0.941 / 0.947 with 100; with 25 0.952 alone. Colours have 0.949 / 0.953 with 33,
            0.946 / 0.947 with 50.
        normals_strength: lambda of equation (10), nats for as many looks.
        concave_share: epsilon of equation (10): what a concave or flat pair costs, of what a convex one does.
        normals_offset: the small constant in d(n_i, n_j) of equation (10), which the paper does not state: what normals
            of neighbours on a plane differ by. A flat pair costs 1.2 nats of one look then, one across a concave right
            angle or a step 0.05, across a convex one 2.1. 0.02 and 0.1 are as good.
        normals_radius: in voxels, from within which normals are averaged; sqrt(27) as in the paper.
        normals_agreement: cosine of the angle up to which a normal has to agree with a voxel's own to be averaged. The
            paper takes all. With its radius that bends the creases along which is to be cut over the size of a cup:
            the median difference of normals across borders falls from 0.7 to 0.13, and on four of the tables it labels
            0.77 / 0.89 at best, with agreeing ones 0.89 / 0.92. cos 26 degrees: about two deviations of their noise.
        normals_step: in voxels, how far two of them may lie apart along their normals and be of one surface; infinity
            for the paper's equation, which has no such limit. On twelve tables (seeds 41 to 44), 50 looks, the classes
            of objects alone: 0.943 / 0.948 by the paper's equation, 0.950 / 0.953 with both numbers here, 0.945 / 0.949
            with this alone; recall of bowls 0.91 / 0.95 and 0.95 / 0.99. From 0.7 to 0.9 with `concave_from` from 0.2
            to 0.4 it is 0.947 to 0.953 / 0.952 to 0.953.
        concave_from: from which difference of unit normals on, 0 to 2, a concave pair costs less than a flat one; 0 for
            the paper's equation. Alone 0.947 / 0.953. In a bowl of 8 cm radius neighbours' normals differ by 0.12 to
            0.22, across a right-angled crease by 1.41.
        colour_strength: lambda of equation (9), the same: the paper gives one for its whole model.
        potts_strength: lambda of equation (8). Nothing makes borders cheaper there: with 100 in place of 50,
            0.76 / 0.87 and not 0.85 / 0.90.
        contrast: theta of equation (9), per squared difference of colours; if None, 1 / (2 <|x_i - x_j|^2>), from the
            mean over all pairs (the usual choice for images; the paper does not state it).
        max_sweeps: of alpha-expansion over all labels, at most.
        fast: mean field in place of alpha-expansion.
        fast_sweeps: of mean field over all voxels.
        bound_sweeps: of the dual bound over all voxels, there and back; 0 for no bound.

    Raises:
        UserError: for a value out of range.
    """

    smoothness: Smoothness = Smoothness.NORMALS
    looks: float = 33.0
    normals_strength: float = 100.0
    concave_share: float = 1.0 / 49.0
    normals_offset: float = 0.05
    normals_radius: float = math.sqrt(27.0)
    normals_agreement: float = 0.9
    normals_step: float = 0.8
    concave_from: float = 0.3
    colour_strength: float = 100.0
    potts_strength: float = 50.0
    contrast: float | None = None
    max_sweeps: int = 8
    fast: bool = False
    fast_sweeps: int = 15
    bound_sweeps: int = 0

    def __post_init__(self) -> None:
        strengths = self.normals_strength, self.colour_strength, self.potts_strength
        costs = *strengths, self.concave_share, self.concave_from, self.contrast or 0.0, self.normals_radius
        positive = self.looks, self.normals_offset
        if not (all(0.0 <= cost < math.inf for cost in costs) and all(0.0 < one < math.inf for one in positive)):
            raise UserError(
                "expected strengths, concave_share, concave_from, contrast and normals_radius >= 0, looks and "
                f"normals_offset > 0, but got {self}"
            )
        if not self.normals_step > 0.0:  # infinity: none
            raise UserError(f"expected normals_step > 0, but got {self}")
        if not -1.0 <= self.normals_agreement < 1.0:
            raise UserError(f"expected normals_agreement in [-1, 1), but got {self}")
        if min(self.max_sweeps, self.fast_sweeps) < 1 or self.bound_sweeps < 0:
            raise UserError(f"expected max_sweeps and fast_sweeps >= 1 and bound_sweeps >= 0, but got {self}")
