"""Birth, marriage and death of landmarks: candidates start, are promoted or dropped; landmarks merge and retire."""

from __future__ import annotations

from collections import Counter

import numpy as np

from ...factors.appearance import ScoreEvidence
from ...factors.size_prior import ClassSizePriors
from ..config import BeliefConfig, EvidenceModels, LifecycleConfig, TrackConfig
from .association import Assignment
from .beliefs import Belief, initial_site, propagate
from .evidence import Observer
from .landmarks import Landmark, volume_overlaps
from .ledger import Look, Scores
from .lifting import LiftedDetection
from .outcomes import Outcome
from .scene import Scene
from .smoother import Smoother
from .tracks import Track
from .view import View

ALWAYS_REFRESHED = 6  # measurements up to which a landmark's marginals are taken at every new one
REFRESH_EVERY = 3  # new measurements between two refreshes after that: a marginal costs 0.3-1 ms


class Lifecycle:
    """Keeps the scene's members; everything that creates, joins or ends one."""

    def __init__(
        self,
        scene: Scene,
        smoother: Smoother,
        observer: Observer,
        priors: ClassSizePriors,
        models: EvidenceModels,
        configs: tuple[TrackConfig, BeliefConfig, LifecycleConfig],
        outcomes: Counter[Outcome],
    ) -> None:
        self._scene, self._smoother, self._observer = scene, smoother, observer
        self._priors, self._models, self._outcomes = priors, models, outcomes
        self._tracks, self._beliefs, self._config = configs
        self._refused: dict[tuple[int, int], int] = {}  # pairs that were not one thing -> their measurements then

    def start_tracks(
        self,
        view: View,
        detections: list[LiftedDetection],
        scores: list[ScoreEvidence],
        assignment: Assignment,
    ) -> None:
        """Detections that show nothing known become candidates."""
        shown = zip(assignment.target, assignment.duplicate_of, strict=True)
        for detection, evidence, (target, duplicate) in zip(detections, scores, shown, strict=True):
            if target >= 0:
                continue
            if duplicate >= 0:
                self._outcomes[Outcome.DUPLICATE] += 1
                continue
            covariance = view.covariance_to_world(detection.covariance())
            belief = Belief(len(detection.scores), self._beliefs, self._models.rate, self._models.free_space)
            track = Track(self._scene.next_track, view.to_world(detection.centre), covariance, belief)
            self._scene.next_track += 1
            weight = belief.views.weight(view.T_world_camera[:3, 3] - track.position)
            track.observations.append((view.keyframe, detection, 1.0, weight))
            track.belief.add_view(weight, 0.0, 0.0)
            track.belief.add_scores(evidence, weight)
            track.hits.add(view.keyframe)
            track.first_seen = track.last_seen = view.frame.stamp
            self._scene.tracks.append(track)
            self._outcomes[Outcome.NEW_TRACK] += 1

    def promote_and_drop(self) -> set[int]:
        """Ripe candidates become landmarks, lost ones go; returns the new landmarks' numbers."""
        kept, promoted = [], set()
        for track in self._scene.tracks:
            track.belief.update()
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
        number = self._scene.next_landmark
        self._scene.next_landmark += 1
        landmark = Landmark(
            number, track.belief, track.position, track.log_size, track.first_seen, track.last_seen, track.covariance
        )
        landmark.supporting, landmark.contradicting = track.hits, track.misses
        known = track.belief.posterior
        if not self._beliefs.size_coupling:
            known = np.eye(len(known))[0]
        site = initial_site(self._priors, known)
        self._smoother.add_landmark(number, track.position, track.log_size, site)
        for keyframe, detection, visible, weight in track.observations:
            scores = np.asarray(detection.scores, dtype=np.float32)
            self._smoother.add(Scores(keyframe, number, scores, 1.0 - visible, weight))
            self._observer.measure(landmark, keyframe, detection, visible, weight)
        belief = track.belief
        self._smoother.add(Look(track.observations[-1][0], number, belief.hits, belief.misses, belief.free))
        self._scene.landmarks[number] = landmark
        self._outcomes[Outcome.PROMOTED] += 1
        return number

    def refresh(self, touched: set[int]) -> None:
        """Landmarks follow the graph; class and size of the touched ones are brought to agree (one EP step each)."""
        for number, landmark in self._scene.landmarks.items():
            landmark.position, landmark.log_size = self._smoother.position(number), self._smoother.log_size(number)
            new = landmark.measurements - landmark.refreshed_at
            if new and (landmark.measurements <= ALWAYS_REFRESHED or new >= REFRESH_EVERY):
                self.refresh_fully(landmark)
            elif number in touched:
                landmark.belief.update()

    def refresh_fully(self, landmark: Landmark) -> None:
        """Takes the landmark's marginals from the graph and does one expectation propagation step."""
        number, smoother = landmark.number, self._smoother
        landmark.position, landmark.log_size = smoother.position(number), smoother.log_size(number)
        covariance, site = smoother.log_size_covariance(number), smoother.sites[number]
        landmark.covariance = smoother.position_covariance(number)
        landmark.log_size_covariance = covariance
        landmark.refreshed_at = landmark.measurements
        if not self._beliefs.size_coupling:
            landmark.belief.update()
            return
        belief, outlier = landmark.belief.log_belief(), self._beliefs.size_outlier
        result = propagate(landmark.log_size, covariance, site, belief, self._priors, outlier)
        landmark.belief.update(result.log_z)
        if site.distance(result.site) > self._beliefs.site_tolerance:
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
            landmark.belief.update()

    def merge(self) -> None:
        """Landmarks whose volumes overlap and whose positions agree under their joint covariance are one thing."""
        landmarks = sorted(self._scene.landmarks.values(), key=lambda landmark: landmark.number)
        overlaps = volume_overlaps(landmarks, self._smoother.R_world_upright)
        gone: set[int] = set()
        for i, j in np.argwhere(np.triu(overlaps > self._config.merge_overlap, k=1)):
            kept, other = landmarks[i], landmarks[j]
            if kept.number in gone or other.number in gone or not self._are_one(kept, other):
                continue
            self._smoother.merge(kept.number, other.number)
            kept.count_from(other)
            kept.belief.update()
            del self._scene.landmarks[other.number]
            gone.add(other.number)
            self._outcomes[Outcome.MERGED] += 1

    def _are_one(self, a: Landmark, b: Landmark) -> bool:
        pair, measurements = (a.number, b.number), a.measurements + b.measurements
        if self._refused.get(pair) == measurements:
            return False
        # a book in the middle of a table is at the same place, but not of the same size
        size_covariance = a.log_size_covariance + b.log_size_covariance + self._config.merge_log_size**2 * np.eye(3)
        unlike = a.log_size - b.log_size
        size = float(unlike @ np.linalg.solve(size_covariance, unlike))
        extent = self._config.merge_extent * min(float(np.mean(a.half_axes)), float(np.mean(b.half_axes)))
        apart, misfit = a.position - b.position, extent**2 * np.eye(3)

        def distance(covariance: np.ndarray) -> float:
            return size + float(apart @ np.linalg.solve(covariance + misfit, apart))

        # Cov(a - b) <= 2 (Cov a + Cov b) spares the joint covariance (36 ms at 1000 keyframes) of what is far apart
        one = distance(2.0 * (a.covariance + b.covariance)) < self._config.merge_gate
        one = one and distance(self._smoother.difference_covariance(*pair)) < self._config.merge_gate
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
