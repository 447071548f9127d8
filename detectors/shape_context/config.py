"""The numbers that the shape-context detector works by."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

ORIENTATIONS, ANGLES, RINGS = 4, 12, 3
"""Bins of a shape context: orientation of the edge, direction and distance of its points (section III-A)."""

LENGTH = ORIENTATIONS * ANGLES * RINGS


class Context(StrEnum):
    """Which edge points a descriptor counts."""

    IMAGE = "image"  # all within its radius, as in the paper
    PROPOSAL = "proposal"  # those of its own proposal: in training images there is nothing but the object


@dataclass(frozen=True, slots=True)
class VotingConfig:
    """How matches become hypotheses and hypotheses the scores of proposals.

    Attributes:
        samples: edge points of one image that are described, at most.
        proposal_samples: of one proposal, at most.
        min_objectness: proposals less probable than this are not looked at.
        matches: K, codebook entries of each class that a descriptor votes for.
        bandwidth: chi-square distance at which a vote counts 1/e; of .05, .1, .2 and .4 the third gave the best average
            precision on rendered tables of seeds below 1000.
        context: which edge points a descriptor counts.
        prune: whether votes that leave their proposal are dropped, equation (1).
        scale_radius: whether the radius follows depth, r = r_t z_t / z.
        upright: whether descriptors and votes turn with the camera, so that contours are those of a thing upright.
        cell: pixels, side of a bin of the heat map.
        smoothing: sigma of the heat map's Gaussian, as a share of the proposal's or, without pruning, of the class's
            usual size in the image.
        maxima: hypotheses of a class in one image (with pruning: in one proposal), at most.
        min_score: hypotheses below this share of the best one of their class in the image (proposal) are left out.
        min_iou: between the box of a hypothesis and that of its proposal (0.5: the paper).
    """

    samples: int = 1000
    proposal_samples: int = 60
    min_objectness: float = 0.02
    matches: int = 10
    bandwidth: float = 0.2
    context: Context = Context.PROPOSAL
    prune: bool = True
    scale_radius: bool = True
    upright: bool = True
    cell: int = 4
    smoothing: float = 0.12
    maxima: int = 2
    min_score: float = 0.3
    min_iou: float = 0.5
