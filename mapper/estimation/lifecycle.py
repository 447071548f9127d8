"""Birth, marriage and death of landmarks: candidates start, are promoted or dropped; landmarks merge and retire."""

from __future__ import annotations

from collections import Counter

import numpy as np

from ...detectors.detections import Part
from ...factors.evidence_model import EvidenceModel
from ...factors.score_model import ScoreEvidence
from ...factors.size_prior import ClassSizePriors
from ..config import MapperConfig
from ..proposals.few_views import Proposal, propose
from .association import Assignment
from .beliefs import Belief
from .evidence import Observer, first_note
from .landmarks import Landmark, volume_overlaps
from .lifting import LiftedDetection
from .outcomes import Outcome
from .reunion import CANDIDATE_SIZE_SIGMA, distance, recall_retired, take_over, unite_candidates
from .scene import Scene
from .separation import separate
from .size_site import initial_site, propagate, size_evidence
from .smoother import Smoother
from .tracks import Observation, Track
from .view import View

ALWAYS_REFRESHED = 6  # measurements up to which a landmark's marginals are taken at every new one
PROPOSED_FROM = 5  # observations from which a candidate's first volume is made
REFRESH_EVERY = 3  # new measurements between two refreshes after that: a marginal costs 0.3-1 ms
SETTLE_EVERY = 5  # keyframes between two propagation steps of what is unsettled and not measured
MERGED_FROM = 3  # measurements from which a landmark's place and size are worth comparing with another's
QUIET = 20  # keyframes without a detection (5 s by hand), after which no more measurements are waited for


class Lifecycle:
    """Keeps the scene's members; everything that creates, joins or ends one."""

    def __init__(
        self,
        scene: Scene,
        smoother: Smoother,
        observer: Observer,
        priors: ClassSizePriors,
        model: EvidenceModel,
        config: MapperConfig,
        outcomes: Counter[Outcome],
    ) -> None:
        self._scene, self._smoother, self._observer = scene, smoother, observer
        self._priors, self._model, self._outcomes = priors, model, outcomes
        self._tracks, self._beliefs, self._config = config.tracks, config.beliefs, config.lifecycle
        self._evidence, self._offset, self._seed = config.evidence, config.lifting.surface_offset, config.seed
        self._refused: dict[tuple[int, int], int] = {}  # pairs that were not one thing -> their measurements then

    def start_tracks(
        self,
        view: View,
        detections: list[LiftedDetection],
        scores: list[ScoreEvidence],
        assignment: Assignment,
    ) -> None:
        """Detections that show nothing known become candidates."""
        self._outcomes[Outcome.DUPLICATE] += int(np.count_nonzero(assignment.duplicate_of >= 0))
        for leader in np.flatnonzero(assignment.starts_new()):
            shown = [int(leader), *np.flatnonzero(assignment.same_as == leader).tolist()]
            self._start_track(view, [detections[i] for i in shown], scores[leader])
            self._outcomes[Outcome.NEW_TRACK] += 1

    def _start_track(self, view: View, shown: list[LiftedDetection], scores: ScoreEvidence) -> None:
        best, belief = shown[0], self.new_belief()
        covariance = view.covariance_to_world(best.covariance())
        track = Track(self._scene.next_track, view.to_world(best.centre), covariance, belief)
        self._scene.next_track += 1
        place = view.T_world_camera[:3, 3] - track.position
        weight = belief.weight(place)
        # what hides a part of it is not known before there is a volume
        belief.look(place, hits=1.0, scores=scores, keyframe=view.keyframe)
        track.log.append(first_note(view, best, belief, weight))
        everything = np.ones(len(Part))
        track.observations.append(Observation(view.keyframe, view.T_world_camera, tuple(shown), everything, weight))
        track.hits.add(view.keyframe)
        track.first_seen = track.last_seen = view.frame.stamp
        self._scene.tracks.append(track)

    def promote_and_drop(self) -> set[int]:
        """Ripe candidates become landmarks, lost ones go; returns the new landmarks' numbers."""
        kept, promoted = [], set()
        for track in self._scene.tracks:
            track.belief.update(self._size_evidence(track))
            if track.is_ripe(self._tracks):
                promoted.add(self._promote(track))
            elif track.is_lost(self._tracks):
                through = track.belief.free < 0.0
                self._outcomes[Outcome.REJECTED_FREE_SPACE if through else Outcome.REJECTED_MISSED] += 1
            else:
                track.predict(self._tracks)
                kept.append(track)
        self._scene.tracks = kept
        return promoted

    def _promote(self, track: Track) -> int:
        proposal = self._propose(track)
        stamps = track.first_seen, track.last_seen
        landmark = self.add_landmark(proposal.position, proposal.log_size, track.covariance, track.belief, stamps)
        landmark.supporting, landmark.contradicting, landmark.log = track.hits, track.misses, track.log
        for seen in track.observations:
            self._observer.record_scores(landmark.number, seen)
            self._observer.measure(landmark, seen)
        self._outcomes[Outcome.PROMOTED] += 1
        return landmark.number

    def new_belief(self) -> Belief:
        """Of something of which nothing is known."""
        evidence = self._evidence
        classes = len(self._model.classes)
        return Belief(classes, self._model, self._beliefs, evidence.presence, evidence.free_space)

    def add_landmark(
        self,
        position: np.ndarray,
        log_size: np.ndarray,
        covariance: np.ndarray,
        belief: Belief,
        stamps: tuple[float, float],
    ) -> Landmark:
        """A new landmark without measurements.

        Args:
            position, covariance: (3,), (3, 3) world, metres.
            log_size: (3,) log half-axes, upright frame.
            belief: what is known of its class and existence.
            stamps: when it was seen first and last, seconds.
        """
        number = self._scene.next_landmark
        self._scene.next_landmark += 1
        landmark = Landmark(number, belief, position, log_size, *stamps, covariance)
        known = belief.posterior if self._beliefs.size_coupling else np.eye(len(belief.posterior))[0]
        self._smoother.add_landmark(number, position, log_size, initial_site(self._priors, known))
        self._scene.landmarks[number] = landmark
        return landmark

    def _propose(self, track: Track) -> Proposal:
        """Where the candidate is and how large, from its latest observations."""
        latest = track.observations[-PROPOSED_FROM:]
        seen = [(one.T_world_camera, detection) for one in latest for detection in one.detections]
        smoother = self._smoother
        posterior = track.belief.class_posterior()
        frame = smoother.intrinsics, smoother.R_world_upright
        return propose(seen, *frame, self._priors, posterior, self._offset, self._seed)

    def _size_evidence(self, track: Track) -> np.ndarray:
        """(K + 1,) what the boxes of a candidate say about its class by its size."""
        if not self._beliefs.size_coupling:
            return track.belief.log_z
        information = np.eye(3) / CANDIDATE_SIZE_SIGMA**2
        return size_evidence(information, information @ track.log_size, self._priors, self._beliefs.size_outlier)

    def refresh(self, touched: set[int]) -> None:
        """Landmarks follow the graph; class and size of the touched ones are brought to agree (one EP step each).

        What has not settled goes on settling while nothing is measured of it, but only every `SETTLE_EVERY` keyframes:
        where the graph has not changed lately a marginal costs 20 ms, most of which those asked for together share.
        """
        settle = self._smoother.keyframes % SETTLE_EVERY == 0
        for number, landmark in self._scene.landmarks.items():
            landmark.position, landmark.log_size = self._smoother.position(number), self._smoother.log_size(number)
            new = landmark.measurements - landmark.refreshed_at
            due = new and (landmark.measurements <= ALWAYS_REFRESHED or new >= REFRESH_EVERY)
            if due or (landmark.unsettled and (new or settle)):
                self.refresh_fully(landmark)
            elif number in touched:
                landmark.belief.update()

    def refresh_fully(self, landmark: Landmark) -> None:
        """Takes the landmark's marginals from the graph and does one expectation propagation step."""
        number, smoother = landmark.number, self._smoother
        landmark.position, landmark.log_size = smoother.position(number), smoother.log_size(number)
        covariance, site = smoother.log_size_covariance(number), smoother.sites[number]
        landmark.covariance = smoother.position_covariance(number)
        landmark.log_size_covariance, landmark.size_site = covariance, site
        landmark.refreshed_at = landmark.measurements
        if not self._beliefs.size_coupling:
            landmark.belief.update()
            return
        numbers = self._beliefs.size_outlier, self._model.existence.weight_size
        belief = landmark.belief.log_belief()
        result = propagate(landmark.log_size, covariance, site, belief, self._priors, *numbers)
        landmark.belief.update(result.log_z)
        landmark.unsettled = site.distance(result.site) > self._beliefs.site_tolerance
        if landmark.unsettled:
            smoother.set_site(number, result.site)

    def bring_up_to_date(self) -> None:
        """Takes everything known into the landmarks, for a reader of the map; a second time changes nothing."""
        smoother = self._smoother
        smoother.settle()
        for landmark in self._scene.landmarks.values():
            if landmark.measurements != landmark.refreshed_at:
                self.refresh_fully(landmark)
        smoother.settle()
        for number, landmark in self._scene.landmarks.items():
            landmark.position, landmark.log_size = smoother.position(number), smoother.log_size(number)
            landmark.covariance = smoother.position_covariance(number)
            landmark.log_size_covariance = smoother.log_size_covariance(number)
            landmark.size_site = smoother.sites[number]
            landmark.belief.update()

    def merge(self, all_seen: bool = False) -> None:
        """Landmarks whose volumes overlap and whose positions agree under their joint covariance are one thing.

        Args:
            all_seen: no more views will come, so that even what was measured once or twice is compared.
        """
        known = [x for x in self._scene.landmarks.values() if all_seen or self._is_measured(x)]
        landmarks = sorted(known, key=lambda landmark: landmark.number)
        overlaps = volume_overlaps(landmarks, self._smoother.R_world_upright)
        gone: set[int] = set()
        for i, j in np.argwhere(np.triu(overlaps > self._config.merge_overlap, k=1)):
            kept, other = landmarks[i], landmarks[j]
            if kept.number in gone or other.number in gone or not self._are_one(kept, other):
                continue
            self._smoother.merge(kept.number, other.number)
            take_over(kept, other)
            del self._scene.landmarks[other.number]
            gone.add(other.number)
            self._outcomes[Outcome.MERGED] += 1

    def separate(self) -> bool:
        """A loop was closed: landmarks into which two things went become two; whether any did. All is solved then."""
        done = separate(self._scene, self._smoother, self, self._model.scores, self._config)
        self._outcomes[Outcome.SEPARATED] += done.made
        return done.mixed > 0

    def reunite(self) -> bool:
        """Poses were corrected: whatever now turns out to be one thing becomes one; whether anything did.

        Landmarks must be up to date, and the smoother has to be updated afterwards.
        """
        self._refused.clear()
        before = self._outcomes[Outcome.MERGED]
        self.merge(all_seen=True)
        self._outcomes[Outcome.MERGED] += recall_retired(self._scene, self._smoother, self._config)
        configs = self._tracks, self._config
        self._outcomes[Outcome.MERGED] += unite_candidates(self._scene, self._smoother, self._observer, *configs)
        return self._outcomes[Outcome.MERGED] > before

    def _is_measured(self, landmark: Landmark) -> bool:
        """Measured often enough to be compared, or as often as it will be for now."""
        last = max(landmark.supporting, default=0)
        return landmark.measurements >= MERGED_FROM or self._smoother.keyframes - last > QUIET

    def _are_one(self, a: Landmark, b: Landmark) -> bool:
        pair, measurements = (a.number, b.number), a.measurements + b.measurements
        if self._refused.get(pair) == measurements:
            return False
        # Cov(a - b) <= 2 (Cov a + Cov b) spares the joint covariance (36 ms at 1000 keyframes) of what is far apart
        one = distance(a, b, 2.0 * (a.covariance + b.covariance), self._config) < self._config.merge_gate
        if one:
            joint = self._smoother.difference_covariance(*pair)
            one = distance(a, b, joint, self._config) < self._config.merge_gate
        if not one:
            self._refused[pair] = measurements
        return one

    def retire(self) -> None:
        """Landmarks that are no objects leave the graph; they stay known as retired."""
        c = self._config
        for number, landmark in list(self._scene.landmarks.items()):
            belief = landmark.belief
            if belief.existence < c.retire_below and belief.effective_views > c.retire_views:
                self._smoother.retire(number)
                self._scene.retired[number] = self._scene.landmarks.pop(number)
                self._outcomes[Outcome.RETIRED] += 1
