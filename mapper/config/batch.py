"""Inference over a fixed set of views."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class ScorePotential(Enum):
    """What a detector's score says for a hypothesis, Psi_s (Meger et al., Explicit Occlusion, 2.3; Clutter, III-D)."""

    OCCLUSION = "occlusion"  # learned densities, given how much is hidden
    LINEAR = "linear"  # a line from -1 to 1
    PLATT = "platt"  # log odds of Platt's probability


@dataclass(frozen=True, slots=True)
class BatchConfig:
    """Inference over a fixed set of views, as both papers of Meger et al. do it (`run --inference batch`)."""

    samples: int = 300  # volumes drawn from detections, by score (Explicit Occlusion, section 3)
    max_iterations: int = 10  # association and optimisation, alternating; about 4 are needed (Clutter, V)
    sliding_spacing: float = 0.5  # of a class's mean size, between neighbouring sliding volumes (Clutter, V)
    score_potential: ScorePotential = ScorePotential.OCCLUSION
    overlap: float = 0.25  # intersection over union in space above which the less likely of two volumes is suppressed
