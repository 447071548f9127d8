"""Proposals as a detector of one class: things of which nobody has said what they are."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...datasets.frame import Frame
from ..detections import Detections
from ..selection import check_selection
from .config import ProposalConfig
from .objectness import Objectness, proposal_features, shipped_objectness
from .proposals import find_proposals

UNKNOWN = "unknown"
"""The class: no object model has it, so that its size says nothing for or against a thing."""


@dataclass(frozen=True, slots=True, eq=False)
class ProposalDetector:
    """Proposals from depth (Georgakis et al., III-A) with the probability that each is one whole thing.

    The same frame gives the same detections. They have masks and do not overlap.

    Attributes:
        confidence: least probability. A half loses few things of a sequence, whose views give many chances, and the map
            believes boxes readily: of rendered maps of two seeds, 0.3 made most false things, 0.7 the fewest and missed
            things of recorded frames.
        max_detections: most of them, the most probable ones.
        edge: whether those cut by the image's edge are given too: their boxes are of a part of the thing.
        config: how proposals are made.
        objectness: the probability of a proposal from its features.

    Raises:
        UserError: for an option out of range.
    """

    confidence: float = 0.5
    max_detections: int = 100
    edge: bool = True
    config: ProposalConfig = field(default_factory=ProposalConfig)
    objectness: Objectness = field(default_factory=shipped_objectness)

    def __post_init__(self) -> None:
        check_selection(self.confidence, self.max_detections)

    @property
    def classes(self) -> tuple[str, ...]:
        """The one class."""
        return (UNKNOWN,)

    def __call__(self, frame: Frame, /) -> Detections:
        """Detections of a frame, most probable first; none where it has no depth."""
        found = find_proposals(frame, self.config)
        if not len(found):
            return Detections.empty(self.classes)
        probability = self.objectness(proposal_features(found, self.config))
        wanted = probability >= self.confidence
        if not self.edge:
            height, width = frame.depth.shape
            wanted &= (found.xyxy[:, :2] > 0).all(axis=1) & (found.xyxy[:, 2:] < [width, height]).all(axis=1)
        order = np.argsort(-probability, kind="stable")
        order = order[wanted[order]][: self.max_detections]
        mask = found.labels == order[:, None, None]
        return Detections(self.classes, found.xyxy[order], probability[order, None], mask=mask)
