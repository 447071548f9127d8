"""The multi-view mode of Georgakis et al. as a mapper: tracks by 3D centroids, Bayes' rule over views."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...datasets.frame import Frame
from ...detectors.detections import Detections
from ...detectors.detector import Detector
from ..config import MapperConfig
from ..estimation.outcomes import Outcome
from ..estimation.view import View
from ..map.object_map import ObjectMap
from ..map.upright import upright_rotation
from ..mapper import MapUpdate, SemanticMapper
from .assessment import Assessment, Fate, assess
from .compose import Composer
from .drawn_boxes import DrawnTracks, draw_tracks
from .judging import judged
from .kept_views import KeptView, ViewStack
from .observations import Observations, observe
from .point_labels import label_points
from .sight import sight
from .track_evidence import TrackEvidence, gather, track_features
from .track_judge import TrackJudge
from .tracks import Tracks


class TrackMapper(SemanticMapper):
    """Maps things as the paper does, to be compared with the full graph on the same detections and the same camera.

    Objects are not in the graph: they do not move the camera, and no prior knows their sizes. Which tracks are things
    is decided when somebody asks, over all views so far under the poses as estimated then.

    Args:
        detector, config, source, gravity: as for `SemanticMapper`; what is known of the detector is of no use here.
        judge: which tracks are things, and which, is decided by what it learned; None for the paper's rules.
    """

    def __init__(
        self,
        detector: Detector | None = None,
        config: MapperConfig | None = None,
        *,
        source: str = "",
        gravity: np.ndarray | None = None,
        judge: TrackJudge | None = None,
    ) -> None:
        super().__init__(detector, config, source=source, gravity=gravity)
        self._judge = judge
        self._tracks = Tracks()
        self._views: list[KeptView] = []
        self._assessment: Assessment | None = None  # of the views so far
        self._evidence: tuple[TrackEvidence, ...] | None = None  # likewise, of every track

    def process_frame(self, frame: Frame, detections: Detections | None = None) -> MapUpdate:
        """Adds one frame; arguments and errors as for `SemanticMapper.process_frame`.

        A UserError too where the judge does not know the detector's classes.

        `things` is the number of tracks that are likelier something than background, seldom seen ones among them.
        """
        with self._clock.stage("odometry"):
            is_keyframe = self._camera.track(frame)
        if is_keyframe:
            with self._clock.stage("detection"):
                found = self._detect(frame, detections)
            with self._clock.stage("observation"):
                observations = self._observe(found, frame)
            with self._clock.stage("keyframe"):
                view = self._camera.add_keyframe(frame)
                self._camera.smoother.update()
                self._camera.match_keyframe()
            with self._clock.stage("tracks"):
                self._track(view, found, observations)
            with self._clock.stage("cloud"):
                self._cloud.add(frame, view.keyframe, self._camera.smoother.pose(view.keyframe))
        self._assessment = self._evidence = None  # where there is no new view, poses may have changed
        return MapUpdate(frame.index, is_keyframe, self._camera.pose(), self._count_things())

    def _observe(self, found: Detections, frame: Frame) -> Observations:
        if self._judge is not None:
            self._judge.check(found.classes)
        observations, refused = observe(found, frame, self.config.lifting, self.config.multiview)
        self._outcomes.update(refused)
        return observations

    def _track(self, view: View, found: Detections, observations: Observations) -> None:
        """One keyframe: association -> class update; the view is kept, to tell later what it could have shown."""
        if not view.placed:
            self._outcomes[Outcome.ADRIFT] += len(observations)
            return
        config, before = self.config.multiview, len(self._tracks)
        poses = self._camera.smoother.poses()
        numbers = self._tracks.add(observations, view.keyframe, poses, config.max_distance)
        self._outcomes[Outcome.NEW_TRACK] += len(self._tracks) - before
        self._outcomes[Outcome.TRACKED] += len(numbers) - (len(self._tracks) - before)
        kept = KeptView.of(view.frame, view.keyframe, found, observations, numbers, config.pixel_step)
        self._views.append(kept)

    def assess(self) -> Assessment | None:
        """What becomes of the tracks so far; None while there is no view."""
        if self._assessment is None and self._views:
            with self._clock.stage("assessment"):
                stack = self._stack()
                centroids = self._tracks.centroids(self._camera.smoother.poses())
                sights = sight(centroids, stack, self.config.multiview)
                log_posterior = self._tracks.log_posterior
                found = assess(log_posterior, centroids, self._views, sights, self.config.multiview)
                if self._judge is not None:
                    found = judged(found, self._gather(found), self._judge, self.config.multiview.extent)
                self._assessment = found
        return self._assessment

    def _gather(self, assessment: Assessment) -> tuple[TrackEvidence, ...]:
        if self._evidence is None:
            poses, axes = self._camera.smoother.poses(), upright_rotation(self._camera.up().direction)
            self._evidence = gather(self._views, poses, axes, assessment.shares)
        return self._evidence

    def object_map(self, include_doubtful: bool = False) -> ObjectMap:
        """The map as estimated now; `include_doubtful` adds tracks that were dropped or are likeliest background."""
        assessment, up = self.assess(), self._camera.up()
        things = ()
        if assessment is not None:
            poses, R_world_upright = self._camera.smoother.poses(), upright_rotation(up.direction)
            numbers = self.config.lifting, self.config.multiview
            composer = Composer(self._classes or (), self._views, poses, R_world_upright, assessment, *numbers)
            things = composer.things(include_doubtful)
        return ObjectMap(
            things,
            self._classes or (),
            self._source,
            self._camera.map_frame,
            up,
            camera=self._camera.intrinsics if self._camera.started else None,
        )

    def point_labels(self) -> np.ndarray | None:
        """(M,) int64 class of every point of `cloud()`, `NO_OBJECT` (-1) for background.

        None where detections came without masks: a box does not say which of its pixels are the object.
        """
        assessment = self.assess()
        if assessment is None or not all(view.has_masks for view in self._views):
            return None
        points, _ = self.cloud()
        with self._clock.stage("point labels"):
            classes = len(self._classes or ())
            same_surface = self.config.multiview.same_surface
            return label_points(points, self._views, self._stack(), assessment.labels, classes, same_surface)

    def image_tracks(self, keyframe: int) -> tuple[np.ndarray, np.ndarray]:
        """Which detections of a keyframe became which track.

        Args:
            keyframe: number, counted from 0.

        Returns:
            (N, 4) boxes in pixels as the detector gave them and (N,) numbers of tracks, -1 for a detection without
            enough depth, or of a part. Nothing of a keyframe whose place was not known.

        Raises:
            IndexError: there is no such keyframe.
        """
        self._check_keyframe(keyframe)
        view = next((view for view in self._views if view.keyframe == keyframe), None)
        if view is None:
            return np.empty((0, 4)), np.empty(0, dtype=np.int64)
        return view.xyxy.copy(), view.track.copy()

    def drawn_tracks(self, keyframe: int) -> DrawnTracks:
        """The tracks that a keyframe shows or could show, where their points of all views would be seen in it.

        Args:
            keyframe: number, counted from 0; nothing is drawn into one whose place was not known.

        Raises:
            IndexError: there is no such keyframe.
        """
        self._check_keyframe(keyframe)
        assessment = self.assess()
        column = next((c for c, view in enumerate(self._views) if view.keyframe == keyframe), None)
        if assessment is None or column is None:
            return DrawnTracks(np.empty(0, np.int64), np.empty((0, 4)), np.empty(0, np.int64), np.empty(0))
        T_upright_world = np.eye(4)
        T_upright_world[:3, :3] = upright_rotation(self._camera.up().direction).T
        T_upright_camera = T_upright_world @ self._camera.smoother.pose(keyframe)
        return draw_tracks(assessment, self._gather(assessment), column, T_upright_camera, self._camera.intrinsics)

    def _check_keyframe(self, keyframe: int) -> None:
        count = self._camera.smoother.keyframes if self._camera.started else 0
        if not 0 <= keyframe < count:
            raise IndexError(f"keyframe must be one of the {count} there are, but got {keyframe}")

    def track_labels(self) -> dict[int, tuple[int, float]]:
        """Number of every track -> its final class, -1 for background and dropped, and that one's probability.

        The background is one of the classes that probabilities are over; a dropped track has the background's.
        """
        assessment = self.assess()
        if assessment is None:
            return {}
        labels = assessment.labels
        return {t: (int(k), float(assessment.posterior[t, k])) for t, k in enumerate(labels)}  # -1: the last column

    def track_scores(self) -> dict[int, float]:
        """Number of every track -> how sure its label is, by which tracks are ranked (`Assessment.per_view`)."""
        assessment = self.assess()
        if assessment is None:
            return {}
        return {t: float(assessment.per_view[t, k]) for t, k in enumerate(assessment.labels)}

    def track_features(self) -> np.ndarray:
        """(T, F) of every track, what a `TrackJudge` learns from; columns as `track_evidence.track_features`."""
        assessment, classes = self.assess(), len(self._classes or ())
        tracks = () if assessment is None else self._gather(assessment)
        return track_features(tracks, classes, self.config.multiview.extent)

    def statistics(self) -> dict[str, Any]:
        """As `SemanticMapper.statistics`, and `tracks`: views, observations, and tracks by what became of them."""
        assessment = self.assess()
        numbers = {
            "views": len(self._views),
            "observations": sum(len(view.observations) for view in self._views),
            "tracks": len(self._tracks),
            **{fate.value: assessment.count(fate) if assessment else 0 for fate in Fate},
        }
        return {**super().statistics(), "evidence_model": "not used by tracks", "tracks": numbers}

    def _stack(self) -> ViewStack:
        """The views, one at least, under the poses as estimated now."""
        self._finish()
        poses, step = self._camera.smoother.poses(), self.config.multiview.pixel_step
        return ViewStack.of(self._views, poses, self._camera.intrinsics, step)

    def _count_things(self) -> int:
        log_posterior = self._tracks.log_posterior
        if len(log_posterior) == 0:
            return 0
        return int(np.count_nonzero(log_posterior.argmax(axis=1) < log_posterior.shape[1] - 1))
