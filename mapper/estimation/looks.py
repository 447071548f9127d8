"""What one keyframe says about every member of the scene, before anybody is told.

Templates are weighted by what of them is visible, the mixture of experts of Explicit Occlusion, equation (4):

    w_i = v_i 1[v_i > theta] / Σ_j v_j 1[v_j > theta],      log p(scores | k) = log Σ_i w_i p(score_i | k, v_i)

over the templates that fired. A look is a hit by the share of the expected firing that came, and a miss by the rest,
as far as the object should have been found at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...factors.evidence_model import EvidenceModel
from ...factors.existence import Evidence
from ...factors.free_space import FreeSpace
from ...factors.score_model import ScoreEvidence
from ...factors.visibility import Visibility, VolumePart
from ..config import EvidenceConfig
from .association import PART_VISIBLE, Targets
from .lifting import LiftedDetection

WHOLE = VolumePart.WHOLE


@dataclass(frozen=True, slots=True, eq=False)
class Looks:
    """M members in one view.

    Attributes:
        visible: (M, 5) share of every part that is in the image and not hidden.
        detected: (M,) whether any template fired.
        hits: (M,) share of the expected firing that came, 0 to 1.
        expected: (M,) how surely it should have been found, 0 to 1; a look misses by (1 - hits) * expected.
        free_ratio: (M,) share of the volume that is free, of what is not hidden.
        seen: (M,) share of the volume that depth tells of: not hidden, in the image, with readings.
        free, depth: (M,) log likelihood of the free ratio and log ratio of the depths, nats, times `seen`.
        shown: for each member the indices of its detections, the one that weighs most first.
        scores: for each member what its detections' scores say; None without any.
    """

    visible: np.ndarray
    detected: np.ndarray
    hits: np.ndarray
    expected: np.ndarray
    free_ratio: np.ndarray
    seen: np.ndarray
    free: np.ndarray
    depth: np.ndarray
    shown: list[list[int]]
    scores: list[ScoreEvidence | None]

    @property
    def misses(self) -> np.ndarray:
        """(M,) by how much each was missed, 0 to 1."""
        return (1.0 - self.hits) * self.expected

    def evidence(self, weights: np.ndarray, classes: int) -> Evidence:
        """Every look as the only one, with (M,) view weights."""
        nothing = ScoreEvidence(np.zeros(classes), np.zeros(classes))
        scores = [nothing if s is None else s for s in self.scores]
        own = np.array([s.own for s in scores]).reshape(-1, classes) * weights[:, None]
        background = np.array([s.background for s in scores]).reshape(-1, classes) * weights[:, None]
        terms = (self.hits, self.misses, self.free, self.depth)
        hits, misses, free, depth = (weights * term for term in terms)
        no_size = np.zeros((len(weights), classes + 1))
        return Evidence(own, background - own, weights * self.detected, hits, misses, free, depth, no_size)


def take_looks(
    detections: list[LiftedDetection],
    detection_of: np.ndarray,
    also_detected: np.ndarray,
    targets: Targets,
    visibility: Visibility,
    posterior: np.ndarray,
    templates: np.ndarray,
    models: tuple[EvidenceModel, FreeSpace, EvidenceConfig],
) -> Looks:
    """What a view says about M targets.

    Args:
        detections: of the view.
        detection_of: (M, 5) index of the detection of each target by each template, -1 without one.
        also_detected: (M,) bool, targets on which a second box lies.
        targets, visibility: as predicted.
        posterior: (M, K) class probabilities of the targets.
        templates: (5,) bool, which templates the detector has.
        models: likelihoods, and what of them is in use.
    """
    model, free_space, config = models
    # where depth has no reading nobody knows what is hidden
    known = 1.0 - visibility.missing[:, WHOLE]
    visible, fired = visibility.visible, detection_of >= 0
    fired[:, WHOLE] |= also_detected & ~fired.any(axis=1)
    weights = template_weights(visible, templates)
    side_px = targets.side_px
    chance = np.stack([model.detection.relative(visible[:, i], side_px, i, posterior) for i in range(5)], axis=1)
    due = (weights * chance).sum(axis=1)
    came = (weights * chance * fired).sum(axis=1)
    detected = np.asarray(fired.any(axis=1))
    # a detection by a template of which nobody expected it is a detection, and no miss of the other templates
    unexpected = detected & (came <= 0.0)
    hits = np.where(unexpected, 1.0, came / np.maximum(due, 1e-12))
    not_hidden = visibility.not_hidden[:, WHOLE]
    free = np.divide(visibility.free[:, WHOLE], not_hidden, out=np.zeros(len(known)), where=not_hidden > 0.0)
    seen = visibility.told[:, WHOLE] * config.depth
    shown, scores = _read_scores(detections, detection_of, visible, weights, model)
    return Looks(
        visible=visible,
        detected=detected,
        hits=hits,
        expected=due * known * config.misses,
        free_ratio=free,
        seen=seen,
        free=free_space.log_likelihood(free) * seen,
        depth=visibility.depth_log_ratio[:, WHOLE] * seen,
        shown=shown,
        scores=scores,
    )


def template_weights(visible: np.ndarray, templates: np.ndarray) -> np.ndarray:
    """(M, 5) w_i of equation (4) from the visible share of every part; rows of zeros where too little is visible."""
    v = visible * (visible > PART_VISIBLE) * templates
    return v / np.maximum(v.sum(axis=1, keepdims=True), 1e-12)


def _read_scores(
    detections: list[LiftedDetection],
    detection_of: np.ndarray,
    visible: np.ndarray,
    weights: np.ndarray,
    model: EvidenceModel,
) -> tuple[list[list[int]], list[ScoreEvidence | None]]:
    """Detections of each target, the one that weighs most first, and the mixture over the templates that fired.

    What the image border cuts off hides the object from the detector as an occluder does.
    """
    shown: list[list[int]] = [[] for _ in detection_of]
    scores: list[ScoreEvidence | None] = [None] * len(detection_of)
    for m in np.flatnonzero((detection_of >= 0).any(axis=1)):
        parts = np.flatnonzero(detection_of[m] >= 0)
        parts = parts[np.argsort(-weights[m, parts], kind="stable")]
        shown[m] = detection_of[m, parts].tolist()
        telling = [i for i in parts if weights[m, i] > 0.0]
        if telling:
            found = [detections[detection_of[m, i]].scores for i in telling]
            hidden = 1.0 - visible[m, telling]
            read = [model.scores.evidence(s, h, i) for s, h, i in zip(found, hidden, telling, strict=True)]
            scores[m] = _mix(read, weights[m, telling])
    return shown, scores


def _mix(evidence: list[ScoreEvidence], weights: np.ndarray) -> ScoreEvidence:
    if len(evidence) == 1:
        return evidence[0]
    log_share = np.log(weights / weights.sum())[:, None]
    own = np.logaddexp.reduce(np.array([e.own for e in evidence]) + log_share, axis=0)
    return ScoreEvidence(own, np.logaddexp.reduce(np.array([e.background for e in evidence]) + log_share, axis=0))
