"""From tracks to the things of a map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...detectors.detections import Part
from ..config import LiftingConfig, MultiViewConfig
from ..estimation.embeddings import EmbeddingMean
from ..estimation.view_log import Verdict, ViewNote
from ..map.appearance import Appearance
from ..map.compose import MIN_LISTED
from ..map.thing import Evidence, Thing
from ..map.views_file import ThingViews
from .assessment import Assessment, Fate
from .kept_views import KeptView
from .sight import Sight

DOUBTFUL = 0.49  # greatest existence of what is dropped or likeliest background: below what a map calls probable
ONE_SIDED = 0.5  # of an extent: its standard deviation where only one view shows it


@dataclass(frozen=True, slots=True, eq=False)
class Composer:
    """Makes things of tracks.

    A thing's existence is 1 - P(background | all views), and nothing else: neither its share of views nor their number
    counts. Posterior and existence are those of the assessment: by Bayes' rule over views taken as independent, which
    they are not, they come out surer than they should. So does the position's covariance, as views from one side are
    wrong together.

    Attributes:
        classes: K names.
        views: V of them.
        T_world_keyframe: (M, 4, 4) of all keyframes.
        R_world_upright: (3, 3) axes of the boxes.
        assessment: of the tracks, over the same views.
        lifting: for the sensor's noise.
        config: for the boxes.
    """

    classes: tuple[str, ...]
    views: Sequence[KeptView]
    T_world_keyframe: np.ndarray
    R_world_upright: np.ndarray
    assessment: Assessment
    lifting: LiftingConfig
    config: MultiViewConfig

    def things(self, include_doubtful: bool) -> tuple[Thing, ...]:
        """The kept tracks, by number; `include_doubtful` adds the others, with an existence below 0.5."""
        fates = self.assessment.fates
        return tuple(self.thing(t) for t, fate in enumerate(fates) if include_doubtful or fate is Fate.KEPT)

    def thing(self, track: int) -> Thing:
        """One track as a thing."""
        a = self.assessment
        posterior = a.posterior[track, :-1] / a.posterior[track, :-1].sum()
        best = int(posterior.argmax())
        position, covariance, size, size_std = self._box(track)
        columns = np.flatnonzero(a.seen[track])
        seen, hidden, missed = (int(which[track].sum()) for which in (a.seen, a.hidden, a.missed))
        return Thing(
            id=f"thing-{track:04d}",
            label=self.classes[best],
            probability=float(posterior[best]),
            existence=self._existence(track),
            class_posterior={self.classes[k]: float(p) for k, p in enumerate(posterior) if p >= MIN_LISTED},
            position=position,
            position_covariance=covariance,
            size=size,
            size_std=size_std,
            yaw=0.0,
            first_seen=self.views[columns[0]].stamp,
            last_seen=self.views[columns[-1]].stamp,
            evidence=Evidence(seen, hidden, missed),
            views=ThingViews(self.classes, self._notes(track), {}),
            appearance=self._appearance(track),
        )

    def _appearance(self, track: int) -> Appearance | None:
        """The mean of the embeddings of its views; all count alike, as Bayes' rule takes them."""
        looks = EmbeddingMean()
        for column in np.flatnonzero(self.assessment.seen[track]).tolist():
            view = self.views[column]
            if view.observations.embedding is not None:
                looks.add(view.keyframe, view.observations.embedding[self._observation(track, column)], 1.0)
        mean = looks.mean()
        return None if mean is None else Appearance(mean, looks.views)

    def _existence(self, track: int) -> float:
        """Of a track that is dropped or background it is at most `DOUBTFUL`, and less the seldomer it was seen."""
        a = self.assessment
        if a.fates[track] is Fate.KEPT:
            return float(a.objects[track])
        return float(min(DOUBTFUL, a.shares[track] * a.objects[track]))

    def _box(self, track: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Centre (3,) of the box, its covariance (3, 3), full extents (3,) and their standard deviations (3,)."""
        points, centroids, ranges = self._observed(track)
        upright = [one @ self.R_world_upright for one in points]
        low, high = np.percentile(np.concatenate(upright), self.config.extent, axis=0)
        size, count = high - low, len(points)
        noise = self.lifting.noise_floor + self.lifting.sensor_noise * float(np.mean(np.square(ranges)))
        if count > 1:
            extents = np.array([np.ptp(np.percentile(one, self.config.extent, axis=0), axis=0) for one in upright])
            scatter, size_std = np.cov(centroids.T), extents.std(axis=0, ddof=1)
        else:
            scatter, size_std = np.cov(points[0].T), ONE_SIDED * size
        covariance = scatter / count + noise**2 * np.eye(3)
        return self.R_world_upright @ (low + high) / 2.0, covariance, size, np.hypot(size_std, noise)

    def _observed(self, track: int) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """Of a track's N observations: (P, 3) points and (N, 3) centroids, world, and (N,) depths along z; metres."""
        points, centroids, ranges = [], [], []
        for column in np.flatnonzero(self.assessment.seen[track]).tolist():
            view, i = self.views[column], self._observation(track, column)
            T = self.T_world_keyframe[view.keyframe]
            points.append(view.observations.points[i] @ T[:3, :3].T + T[:3, 3])
            centroids.append(T[:3, :3] @ view.observations.centroid[i] + T[:3, 3])
            ranges.append(view.observations.centroid[i, 2])
        return points, np.array(centroids), np.array(ranges)

    def _observation(self, track: int, column: int) -> int:
        """Which of a view's observations is of the track."""
        view = self.views[column]
        return int(np.flatnonzero(view.track[view.observations.row] == track)[0])

    def _notes(self, track: int) -> tuple[ViewNote, ...]:
        """What each view that had the track in its image said."""
        a = self.assessment
        concerned = np.flatnonzero(a.seen[track] | (a.sight[track] != Sight.OUT))
        return tuple(self._note(track, int(column)) for column in concerned)

    def _note(self, track: int, column: int) -> ViewNote:
        """One view: it counts in full, and of what is visible no more is known than whether the centroid was."""
        view, a = self.views[column], self.assessment
        seen = bool(a.seen[track, column])
        visible = seen or a.sight[track, column] == Sight.VISIBLE
        score, class_id, log_ratio = np.nan, -1, np.zeros(len(self.classes))
        if seen:
            i = self._observation(track, column)
            score, class_id = float(view.observations.confidence[i]), int(view.observations.class_id[i])
            log_ratio = view.observations.log_distribution[i, :-1] - view.observations.log_distribution[i, -1]
        return ViewNote(
            keyframe=view.keyframe,
            stamp=view.stamp,
            frame=view.name,
            visible=np.full(len(Part), float(visible)),
            score=score,
            part=int(Part.WHOLE) if seen else -1,
            class_id=class_id,
            log_ratio=log_ratio,
            weight=1.0,
            verdict=Verdict.SUPPORTED if seen else Verdict.MISSED if visible else Verdict.OCCLUDED,
        )
