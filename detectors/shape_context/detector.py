"""The detector: proposals told apart by what their contours vote for."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...datasets.frame import Frame
from ..detections import Detections
from ..proposals.config import ProposalConfig
from ..proposals.objectness import Objectness, proposal_features, shipped_objectness
from ..proposals.proposals import Proposals, find_proposals
from ..selection import check_selection
from .config import VotingConfig
from .model import ShapeContextModel, load_model
from .scoring import ImageScores, score_frame


class ShapeContextDetector:
    """Classes of 3D proposals by shape contexts and Hough votes (Georgakis et al., III-A); no network, no texture.

    The same frame gives the same detections: one for each proposal that is probably of a class, with its mask, and the
    distribution over the classes; what it falls short of 1 by is the background's.

    Args:
        model: a model, or the file of one.
        confidence: least probability of the best class.
        max_detections: most of them, the most probable ones.
        voting: instead of the model's own; its scores are then calibrated no more.
        proposals: how proposals are made.
        objectness: by which those are left out that are hardly one thing.

    Raises:
        UserError: an option out of range.
        InputError: the file is not a model.
    """

    def __init__(
        self,
        model: ShapeContextModel | str | Path,
        confidence: float = 0.1,
        max_detections: int = 100,
        voting: VotingConfig | None = None,
        proposals: ProposalConfig | None = None,
        objectness: Objectness | None = None,
    ) -> None:
        check_selection(confidence, max_detections)
        self.model = model if isinstance(model, ShapeContextModel) else load_model(model)
        self.confidence, self.max_detections = confidence, max_detections
        self.voting = voting or self.model.voting
        self._proposals = proposals or ProposalConfig()
        self._objectness = objectness or shipped_objectness()

    @property
    def classes(self) -> tuple[str, ...]:
        """Of the model."""
        return self.model.classes

    def __call__(self, frame: Frame, /) -> Detections:
        """Detections of a frame, most probable first; none where it has no depth."""
        found, scores = self.score(frame)
        if not len(found):
            return Detections.empty(self.classes)
        probability = self.model.calibration.distribution(scores.normalised)[:, :-1]
        best = np.where(np.isfinite(scores.normalised).any(axis=1), probability.max(axis=1), 0.0)
        order = np.argsort(-best, kind="stable")
        order = order[(best[order] >= self.confidence) & (best[order] > 0.0)][: self.max_detections]
        return Detections(
            self.classes, found.xyxy[order], probability[order], mask=found.labels == order[:, None, None]
        )

    def score(self, frame: Frame) -> tuple[Proposals, ImageScores]:
        """The frame's proposals, and what every class says of them."""
        found = find_proposals(frame, self._proposals)
        looked_at = np.zeros(len(found), dtype=bool)
        if len(found):
            looked_at = self._objectness(proposal_features(found, self._proposals)) >= self.voting.min_objectness
        return found, score_frame(frame, found, looked_at, self.model.codebooks, self.voting)
