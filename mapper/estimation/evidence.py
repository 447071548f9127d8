"""What one keyframe says about every member of the scene: measurements for the graph, evidence for the beliefs."""

from __future__ import annotations

from collections import Counter

import numpy as np
from scipy.special import logsumexp

from ...factors.appearance import AppearanceModel, ScoreEvidence
from ...factors.visibility import Visibility
from ..config import EvidenceModels
from .association import Assignment, Targets
from .landmarks import Landmark
from .ledger import Box, DepthCentre, Look, Scores
from .lifting import LiftedDetection
from .outcomes import Outcome
from .scene import WHOLE, Scene
from .smoother import Smoother
from .tracks import Track
from .view import View

EXPECTED = 0.5  # expected detection rate above which not being detected is counted as a miss
SEEN_THROUGH = 0.7  # free ratio above which a view is counted as seeing through the volume
NEW_VIEW = 0.3  # view weight above which a detection becomes a measurement of the graph
FIRST_MEASUREMENTS = 4  # measurements that enter the graph whatever their view weight


def class_evidence(scores: list[ScoreEvidence], members: list[Landmark | Track]) -> np.ndarray:
    """(N, M) log ratio of each detection's scores under a member's class posterior against an unknown class, nats."""
    if not scores or not members:
        return np.zeros((len(scores), len(members)))
    own = np.array([s.own for s in scores])
    posterior = np.array([m.belief.class_posterior() for m in members])
    with np.errstate(divide="ignore"):
        joint = logsumexp(np.log(posterior)[None] + own[:, None], axis=2)
    return joint - (logsumexp(own, axis=1) - np.log(own.shape[1]))[:, None]


def score_evidence(detections: list[LiftedDetection], model: AppearanceModel) -> list[ScoreEvidence]:
    """What the detections' scores say as long as nothing is known of their occlusion."""
    return [model.evidence(d.scores, 0.0) for d in detections]


class Observer:
    """Applies an assignment: every member of the scene hears what this view said about it."""

    def __init__(self, scene: Scene, smoother: Smoother, models: EvidenceModels, outcomes: Counter[Outcome]) -> None:
        self._scene, self._smoother, self._models, self._outcomes = scene, smoother, models, outcomes

    def observe(
        self,
        view: View,
        detections: list[LiftedDetection],
        assignment: Assignment,
        targets: Targets,
        visibility: Visibility,
    ) -> set[int]:
        """Adds the view's evidence to all members; returns the numbers of the landmarks it touched."""
        # where depth has no reading nobody knows what is hidden
        known = 1.0 - visibility.missing[:, WHOLE]
        expected = self._models.rate.expected(targets.visible, targets.side_px) * known * self._models.misses
        seen = visibility.agreeing[:, WHOLE] + visibility.free[:, WHOLE]
        free = np.divide(visibility.free[:, WHOLE], seen, out=np.zeros(len(seen)), where=seen > 0)
        free_look = self._models.free_space.log_likelihood(free) * seen * known * visibility.in_image[:, WHOLE]
        touched = set()
        for m, member in enumerate(self._scene.members()):
            own = np.flatnonzero(assignment.target == m)
            hit = len(own) > 0 or bool(np.any(assignment.duplicate_of == m))
            # what hardly shows says nothing, nor does it use up its direction for a later look
            if not hit and expected[m] <= 0.0 and seen[m] * known[m] * visibility.in_image[m, WHOLE] < EXPECTED:
                self._count_unseen(member, view.keyframe, visibility.in_image[m, WHOLE])
                continue
            weight = member.belief.views.weight(view.T_world_camera[:3, 3] - member.position)
            look = (weight * hit, weight * (not hit) * expected[m], weight * free_look[m])
            member.belief.add_view(*look)
            if len(own):
                self._detected(member, view, detections[own[0]], float(targets.visible[m]), weight)
            self._count(member, view, hit, float(expected[m]), float(free[m] * (seen[m] > EXPECTED)))
            if isinstance(member, Landmark):
                self._smoother.add(Look(view.keyframe, member.number, *map(float, look)))
                touched.add(member.number)
        return touched

    def measure(
        self, landmark: Landmark, keyframe: int, detection: LiftedDetection, visible: float, weight: float
    ) -> None:
        """Puts a detection of a landmark into the graph, unless the view adds nothing."""
        if weight < NEW_VIEW and landmark.measurements >= FIRST_MEASUREMENTS:
            return
        share = max(visible, 0.1)
        d, add = detection, self._smoother.add
        sigmas = d.sigma_tangential, d.sigma_range
        add(DepthCentre(keyframe, landmark.number, d.centre, *sigmas, share))
        add(Box(keyframe, landmark.number, d.xyxy, d.sides_seen, d.sigma_px / np.sqrt(share)))
        landmark.measurements += 1

    def _detected(
        self, member: Landmark | Track, view: View, detection: LiftedDetection, visible: float, weight: float
    ) -> None:
        # what is cut off by the image border hides the object from the detector as an occluder does
        occlusion = 1.0 - visible
        member.belief.add_scores(self._models.appearance.evidence(detection.scores, occlusion), weight)
        if isinstance(member, Landmark):
            scores = np.asarray(detection.scores, dtype=np.float32)
            self._smoother.add(Scores(view.keyframe, member.number, scores, occlusion, weight))
            self.measure(member, view.keyframe, detection, visible, weight)
            self._outcomes[Outcome.ASSOCIATED] += 1
        else:
            member.correct(view.to_world(detection.centre), view.covariance_to_world(detection.covariance()))
            member.observations.append((view.keyframe, detection, visible, weight))
            self._outcomes[Outcome.TRACKED] += 1

    def _count_unseen(self, member: Landmark | Track, keyframe: int, in_image: float) -> None:
        if not isinstance(member, Landmark):
            return
        if in_image > 0.0:
            member.occluded.add(keyframe)
        self._outcomes[Outcome.FULLY_OCCLUDED if in_image > 0.0 else Outcome.OUT_OF_VIEW] += 1

    def _count(self, member: Landmark | Track, view: View, hit: bool, expected: float, free: float) -> None:
        missed = not hit and expected > EXPECTED
        if hit:
            member.last_seen = view.frame.stamp
        if isinstance(member, Track):
            if hit or missed:
                (member.hits if hit else member.misses).add(view.keyframe)
            member.misses_in_a_row = 0 if hit else member.misses_in_a_row + missed
            return
        through = not hit and free > SEEN_THROUGH
        if hit:
            outcome, views = Outcome.SUPPORTED, member.supporting
        elif through or missed:
            outcome, views = Outcome.SEEN_THROUGH if through else Outcome.MISSED, member.contradicting
        else:
            outcome, views = Outcome.FULLY_OCCLUDED, member.occluded
        views.add(view.keyframe)
        self._outcomes[outcome] += 1
