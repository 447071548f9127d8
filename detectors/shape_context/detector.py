"""The detector: proposals told apart by what their contours vote for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...datasets.frame import Frame
from ..detections import Detections
from ..proposals.config import ProposalConfig
from ..proposals.objectness import Objectness, proposal_features, shipped_objectness
from ..proposals.proposals import Proposals, find_proposals
from ..selection import check_selection
from .calibration import calibration_features
from .config import VotingConfig
from .model import ShapeContextModel, load_model, shipped_model
from .scoring import ImageScores, score_frame


@dataclass(frozen=True, slots=True, eq=False)
class ScoredProposals:
    """The N proposals of a frame, C classes.

    Attributes:
        proposals: of the frame.
        objectness: (N,) probability of being one whole thing.
        looked_at: (N,) bool; the scores of the others say nothing.
        scores: what the classes say.
        probability: (N, C + 1), the background's last.
    """

    proposals: Proposals
    objectness: np.ndarray
    looked_at: np.ndarray
    scores: ImageScores
    probability: np.ndarray


class ShapeContextDetector:
    """Classes of 3D proposals by shape contexts and Hough votes (Georgakis et al., III-A); no network, no texture.

    The same frame gives the same detections: one for each proposal that is probably of a class, with its mask, and the
    distribution over the classes; what it falls short of 1 by is the background's. All classes and the background are
    taken to be equally frequent, so that Bayes' rule over views (equation 2) multiplies what the views say alone.

    Args:
        model: a model, or the file of one; None for the shipped one, of the synthetic world's things.
        confidence: least probability of the best class; 0 gives all proposals that are looked at, which the multi-view
            mode needs: it weighs views that say background too.
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
        model: ShapeContextModel | str | Path | None = None,
        confidence: float = 0.5,
        max_detections: int = 100,
        voting: VotingConfig | None = None,
        proposals: ProposalConfig | None = None,
        objectness: Objectness | None = None,
    ) -> None:
        check_selection(confidence, max_detections)
        if not isinstance(model, ShapeContextModel):
            model = load_model(shipped_model() if model is None else model)
        self.model = model
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
        scored = self.score(frame)
        if not scored.looked_at.any():
            return Detections.empty(self.classes)
        best = np.where(scored.looked_at, scored.probability[:, :-1].max(axis=1), -1.0)
        order = np.argsort(-best, kind="stable")
        order = order[best[order] >= self.confidence][: self.max_detections]
        found = scored.proposals
        mask = found.labels == order[:, None, None]
        return Detections(self.classes, found.xyxy[order], scored.probability[order, :-1], mask=mask)

    def score(self, frame: Frame) -> ScoredProposals:
        """The frame's proposals, and what every class says of them."""
        found = find_proposals(frame, self._proposals)
        objectness = self._objectness(proposal_features(found, self._proposals)) if len(found) else np.zeros(0)
        looked_at = objectness >= self.voting.min_objectness
        scores = score_frame(frame, found, looked_at, self.model.codebooks, self.voting, self.model.rivals)
        probability = self.model.calibration.distribution(calibration_features(scores, objectness))
        return ScoredProposals(found, objectness, looked_at, scores, probability)
