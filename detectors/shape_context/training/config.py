"""Numbers of training."""

from __future__ import annotations

from dataclasses import dataclass, field

from ...proposals.config import ProposalConfig
from ..config import VotingConfig


@dataclass(frozen=True, slots=True)
class TrainConfig:
    """How codebooks are learned; together with the sources it decides the model to the last bit.

    Attributes:
        seed: of which instances and views are held out.
        radii: metres, candidates for the radius of descriptors.
        entries: of a class's codebook, at most.
        views: of a class that are learned from, at most, spread evenly.
        held_out: share of instances, or of views, that only the choice of the radius and the calibration see.
        held_out_views: of a class, at most.
        other_views: held-out views of other classes that radii are judged on for a class, at most, spread evenly.
        frames: of the backgrounds, at most, spread evenly: half of them for radii and
            rivals, half for the calibration.
        fewest_points: edge points of an object; a view with fewer shows no shape.
        known_overlap: intersection over union of boxes from which a proposal shows a known object, and
        clear_overlap: below which it shows none; between the two it is neither.
        rivals: descriptors of things that are none of the classes, for each radius, at most.
        voting: what the model's detector will work by; codebooks and scores are made in the same way.
        proposals: likewise.
        memory: bytes of images kept; the rest is read anew each time. Has no influence on the model.
    """

    seed: int = 0
    radii: tuple[float, ...] = (0.03, 0.045, 0.07, 0.1, 0.15, 0.22)
    entries: int = 2500
    views: int = 300
    held_out: float = 0.2
    held_out_views: int = 60
    other_views: int = 120
    frames: int = 160
    fewest_points: int = 20
    known_overlap: float = 0.5
    clear_overlap: float = 0.3
    rivals: int = 5000
    voting: VotingConfig = field(default_factory=VotingConfig)
    proposals: ProposalConfig = field(default_factory=ProposalConfig)
    memory: int = 800_000_000
