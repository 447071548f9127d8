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

    Attributes:
        smoothness: which pairwise term.
        normals_strength: lambda of equation (10), nats.
        concave_share: epsilon of equation (10): what a concave or flat pair costs, of what a convex one does.
        normals_offset: the small constant in d(n_i, n_j) of equation (10), which the paper does not state. With 0.5 a
            flat pair costs 4.1 nats, a pair across a concave right angle 1.1, across a convex one 53. In the rooms of
            benchmarks/mrf.py, anything from 0.1 to 1 labels alike.
        plain_strength: lambda of equations (8) and (9), nats. The paper gives the lambda of its whole model only, and
            there epsilon multiplies it on flat surfaces, where (8) and (9) have nothing of the kind: with 100, nothing
            that detectors say (a few nats a voxel, equation 7) outweighs a border, and all becomes background.
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
    normals_strength: float = 100.0
    concave_share: float = 1.0 / 49.0
    normals_offset: float = 0.5
    plain_strength: float = 2.0
    contrast: float | None = None
    max_sweeps: int = 8
    fast: bool = False
    fast_sweeps: int = 15
    bound_sweeps: int = 0

    def __post_init__(self) -> None:
        costs = (self.normals_strength, self.concave_share, self.plain_strength, self.contrast or 0.0)
        if not (all(0.0 <= cost < math.inf for cost in costs) and 0.0 < self.normals_offset < math.inf):
            raise UserError(f"expected strengths, shares and contrast >= 0 and normals_offset > 0, but got {self}")
        if min(self.max_sweeps, self.fast_sweeps) < 1 or self.bound_sweeps < 0:
            raise UserError(f"expected max_sweeps and fast_sweeps >= 1 and bound_sweeps >= 0, but got {self}")
