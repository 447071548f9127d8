"""Every member of the scene hears what a keyframe said about it: measurements for the graph, evidence for beliefs."""

from __future__ import annotations

from collections import Counter

import numpy as np
from scipy.special import logsumexp

from ...detectors.detections import Part
from ...factors.evidence_model import EvidenceModel
from ...factors.score_model import ScoreEvidence
from ...factors.visibility import Visibility
from ..config import EvidenceConfig
from .association import Assignment, Targets
from .beliefs import Belief
from .landmarks import Landmark
from .lifting import LiftedDetection
from .looks import WHOLE, Looks, take_looks
from .outcomes import Outcome
from .records import Box, DepthCentre, Look, Scores
from .scene import Scene
from .smoother import Smoother
from .tracks import Observation, Track
from .view import View
from .view_log import Verdict, ViewNote

EXPECTED = 0.5  # expected detection rate above which not being detected is counted as a miss
SEEN_THROUGH = 0.7  # free ratio above which a view is counted as seeing through the volume
NEW_VIEW = 0.3  # view weight above which a detection becomes a measurement of the graph
FIRST_MEASUREMENTS = 4  # measurements that enter the graph whatever their view weight
LEAST_WEIGHT = 1e-3  # of an embedding from where others came: where all are such, their mean is still theirs
OUTCOMES = {
    Verdict.SUPPORTED: Outcome.SUPPORTED,
    Verdict.SEEN_THROUGH: Outcome.SEEN_THROUGH,
    Verdict.MISSED: Outcome.MISSED,
    Verdict.OCCLUDED: Outcome.FULLY_OCCLUDED,
    Verdict.UNCLEAR: Outcome.UNCLEAR,
}


def class_evidence(scores: list[ScoreEvidence], members: list[Landmark | Track]) -> np.ndarray:
    """(N, M) log ratio of each detection's scores under a member's class posterior against an unknown class, nats."""
    if not scores or not members:
        return np.zeros((len(scores), len(members)))
    own = np.array([s.own for s in scores])
    posterior = np.array([m.belief.class_posterior() for m in members])
    with np.errstate(divide="ignore"):
        joint = logsumexp(np.log(posterior)[None] + own[:, None], axis=2)
    return joint - (logsumexp(own, axis=1) - np.log(own.shape[1]))[:, None]


def score_evidence(detections: list[LiftedDetection], model: EvidenceModel) -> list[ScoreEvidence]:
    """What the detections' scores say as long as nothing is known of their occlusion."""
    return [model.scores.evidence(d.scores, 0.0, d.part) for d in detections]


class Observer:
    """Applies an assignment.

    Args:
        scene: whose members hear it.
        smoother: where measurements go.
        model: the learned likelihoods, of the detector's classes.
        config: what of them is in use.
        outcomes: counted here.
    """

    def __init__(
        self,
        scene: Scene,
        smoother: Smoother,
        model: EvidenceModel,
        config: EvidenceConfig,
        outcomes: Counter[Outcome],
    ) -> None:
        self._scene, self._smoother, self._outcomes = scene, smoother, outcomes
        self._model, self._config = model, config
        # a detector has the templates that it was seen to use: halves that never fire are not missed
        self._templates = np.arange(len(Part)) == Part.WHOLE

    def observe(
        self,
        view: View,
        detections: list[LiftedDetection],
        assignment: Assignment,
        targets: Targets,
        visibility: Visibility,
    ) -> set[int]:
        """Adds the view's evidence to all members; returns the numbers of the landmarks it touched."""
        self._templates[[d.part for d in detections]] = True
        members = self._scene.members()
        if not members:
            return set()
        posterior = np.array([member.belief.class_posterior() for member in members])
        second = np.isin(np.arange(len(members)), assignment.duplicate_of)
        models = self._model, self._config.free_space, self._config
        shown_by = np.array([assignment.shown_by(m) for m in range(len(members))])
        found = detections, shown_by, second
        looks = take_looks(*found, targets, visibility, posterior, self._templates, models)
        weights = np.array([m.belief.weight(view.T_world_camera[:3, 3] - m.position) for m in members])
        ratios = self._log_ratios(looks, weights, posterior.shape[1])
        touched = set()
        for m, member in enumerate(members):
            if visibility.in_image[m, WHOLE] <= 0.0 and not looks.detected[m]:
                self._outcomes[Outcome.OUT_OF_VIEW] += isinstance(member, Landmark)
                continue
            verdict = _verdict(looks, m, float(ratios[m] @ posterior[m]))
            # what hardly shows says nothing, nor does it use up its direction for a later look
            tells = looks.detected[m] or looks.expected[m] > 0.0 or looks.seen[m] >= EXPECTED
            missed = verdict.contradicts or bool(looks.misses[m] > EXPECTED)
            self._count(member, view, verdict, missed)
            member.log.append(_note(view, detections, looks, m, ratios[m] * tells, weights[m] * tells, verdict))
            if tells:
                self._tell(member, view, looks, m)
                if looks.shown[m]:
                    shown = tuple(detections[i] for i in looks.shown[m])
                    self._detected(
                        member,
                        view,
                        Observation(view.keyframe, view.T_world_camera, shown, looks.visible[m], weights[m]),
                    )
                if isinstance(member, Landmark):
                    touched.add(member.number)
        return touched

    def measure(self, landmark: Landmark, seen: Observation) -> None:
        """Puts how a keyframe showed a landmark into the graph, unless the view adds nothing."""
        if seen.weight < NEW_VIEW and landmark.measurements >= FIRST_MEASUREMENTS:
            return
        keys, add = (seen.keyframe, landmark.number), self._smoother.add
        for d, share in zip(seen.detections, seen.shares, strict=True):
            add(DepthCentre(*keys, d.centre, d.sigma_tangential, d.sigma_range, float(share)))
            add(Box(*keys, d.xyxy, d.sides_seen, d.sigma_px / np.sqrt(share), d.part))
        landmark.measurements += 1

    def record_scores(self, number: int, seen: Observation) -> None:
        """Puts the scores of a landmark's detections into the ledger, and what they look like into its mean.

        An embedding weighs as the scores beside it do: how new the view was, times the share of the template. Which
        landmark a detection shows was decided before (`associate`): it is of that one with its whole weight.
        """
        looks = self._scene.landmarks[number].embedding
        for d, share in zip(seen.detections, seen.shares, strict=True):
            if d.embedding is not None:
                looks.add(seen.keyframe, d.embedding, max(seen.weight, LEAST_WEIGHT) * float(share))
        for d in seen.detections:
            scores, occlusion = np.asarray(d.scores, dtype=np.float32), 1.0 - float(seen.visible[d.part])
            self._smoother.add(Scores(seen.keyframe, number, scores, occlusion, seen.weight, d.part))

    def _log_ratios(self, looks: Looks, weights: np.ndarray, classes: int) -> np.ndarray:
        """(M, K) log p(view | of class k) - log p(view | no object), each view by itself."""
        existence = self._model.existence
        alone = existence.log_belief(looks.evidence(weights, classes)) - existence.log_prior(classes)
        return alone[:, 1:] - alone[:, :1]

    def _tell(self, member: Landmark | Track, view: View, looks: Looks, m: int) -> None:
        place, belief = view.T_world_camera[:3, 3] - member.position, member.belief
        hits, misses, free, depth = (float(x[m]) for x in (looks.hits, looks.misses, looks.free, looks.depth))
        belief.look_for(place, float(looks.free_ratio[m]), float(looks.seen[m]), bool(looks.detected[m]))
        belief.look(place, hits, misses, free, depth, float(looks.seen[m]), looks.scores[m], view.keyframe)
        if isinstance(member, Landmark):
            visible = np.asarray(looks.visible[m], dtype=np.float32)
            seen = float(looks.seen[m])
            self._smoother.add(Look(view.keyframe, member.number, hits, misses, free, visible, depth, seen))

    def _detected(self, member: Landmark | Track, view: View, seen: Observation) -> None:
        if isinstance(member, Landmark):
            self.record_scores(member.number, seen)
            self.measure(member, seen)
            self._outcomes[Outcome.ASSOCIATED] += len(seen.detections)
        else:
            best = seen.detections[0]
            member.see(seen, view.to_world(best.centre), view.covariance_to_world(best.covariance()))
            self._outcomes[Outcome.TRACKED] += len(seen.detections)

    def _count(self, member: Landmark | Track, view: View, verdict: Verdict, missed: bool) -> None:
        hit = verdict is Verdict.SUPPORTED
        if hit:
            member.last_seen = view.frame.stamp
        if isinstance(member, Track):
            if hit or missed:
                (member.hits if hit else member.misses).add(view.keyframe)
            member.misses_in_a_row = 0 if hit else member.misses_in_a_row + missed
            return
        contradicts = verdict.contradicts
        (member.supporting if hit else member.contradicting if contradicts else member.occluded).add(view.keyframe)
        self._outcomes[OUTCOMES[verdict]] += 1


def first_note(view: View, detection: LiftedDetection, belief: Belief, weight: float) -> ViewNote:
    """What the view said in which a candidate was seen first; what hid a part of it is not known."""
    return ViewNote(
        keyframe=view.keyframe,
        stamp=view.frame.stamp,
        frame=view.frame.name,
        visible=np.ones(len(Part)),
        score=detection.confidence,
        part=detection.part,
        class_id=detection.class_id,
        log_ratio=belief.log_ratio(),
        weight=weight,
        verdict=Verdict.SUPPORTED,
    )


def _verdict(looks: Looks, m: int, log_ratio: float) -> Verdict:
    """What a view comes to; `log_ratio` is what it says for the member's likely classes, nats."""
    if looks.detected[m]:
        return Verdict.SUPPORTED
    if looks.free_ratio[m] > SEEN_THROUGH and looks.seen[m] > EXPECTED:
        return Verdict.SEEN_THROUGH
    if looks.misses[m] > EXPECTED and log_ratio < 0.0:
        return Verdict.MISSED
    return Verdict.OCCLUDED if looks.visible[m, WHOLE] < EXPECTED else Verdict.UNCLEAR


def _note(
    view: View,
    detections: list[LiftedDetection],
    looks: Looks,
    m: int,
    log_ratio: np.ndarray,
    weight: float,
    verdict: Verdict,
) -> ViewNote:
    best = None if not looks.shown[m] else detections[looks.shown[m][0]]
    return ViewNote(
        keyframe=view.keyframe,
        stamp=view.frame.stamp,
        frame=view.frame.name,
        visible=looks.visible[m],
        score=float("nan") if best is None else best.confidence,
        part=-1 if best is None else best.part,
        class_id=-1 if best is None else best.class_id,
        log_ratio=log_ratio,
        weight=float(weight),
        verdict=verdict,
    )
