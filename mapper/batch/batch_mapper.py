"""A mapper that looks at a fixed set of views all at once, as both papers of Meger et al. do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np

from ...datasets.frame import Frame
from ...detectors.detections import Detections
from ...detectors.detector import Detector
from ...factors.evidence_model import EvidenceModel
from ..config import MapperConfig
from ..estimation.landmarks import Landmark
from ..estimation.outcomes import Outcome
from ..estimation.scene import Scene
from ..estimation.smoother import Smoother
from ..estimation.view import View
from ..map.object_map import ObjectMap
from ..mapper import MapUpdate, SemanticMapper
from ..proposals.views import StoredView
from ..proposals.volumes import VolumeHypothesis
from .inference import Inference, infer_volumes
from .view_camera import ViewCamera


class BatchMapper(SemanticMapper):
    """Maps things from some views of a sequence; the other frames only tell how the camera moved.

    Inference happens when somebody asks for what is mapped, over the views so far. It starts from the camera's
    measurements alone each time, so that asking early, or twice, changes no later map. Poses are those of the joint
    estimate once there is one, and the camera's own before.

    Args:
        detector, config, source, gravity, model: as for `SemanticMapper`.
        views: which of the processed frames are views, counted from 0.
    """

    def __init__(
        self,
        detector: Detector | None = None,
        config: MapperConfig | None = None,
        *,
        views: Iterable[int],
        source: str = "",
        gravity: np.ndarray | None = None,
        model: EvidenceModel | None = None,
    ) -> None:
        super().__init__(detector, config, source=source, gravity=gravity, model=model)
        self._camera: ViewCamera = ViewCamera(self.config, gravity)
        self._view_numbers = frozenset(views)
        self._processed = 0
        self._stored: list[StoredView] = []
        self._refused = self._outcomes  # of detections, counted as the views come
        self._camera_only: Smoother | None = None  # while the camera answers with the joint estimate
        self._inference: Inference | None = None

    def process_frame(self, frame: Frame, detections: Detections | None = None) -> MapUpdate:
        """Adds one frame; arguments and errors as for `SemanticMapper.process_frame`.

        The detector is asked on views only. `things` is the number found when last asked for a map.
        """
        self._forget_inference()
        is_view = self._processed in self._view_numbers
        with self._clock.stage("odometry"):
            if is_view:
                self._camera.track_view(frame)
            is_keyframe = is_view or self._camera.track(frame)
        found = None
        if is_view:
            with self._clock.stage("detection"):
                found = self._detect(frame, detections)
        if is_keyframe:
            with self._clock.stage("keyframe"):
                view = self._camera.add_keyframe(frame)
                self._camera.smoother.update()
                self._camera.match_keyframe()
            if found is not None:
                self._stored.append(StoredView.of(frame, view.keyframe, self._lift(found, frame)))
            with self._clock.stage("cloud"):
                self._cloud.add(frame, view.keyframe, self._camera.smoother.pose(view.keyframe))
        self._processed += 1
        return MapUpdate(frame.index, is_keyframe, self._camera.pose(), self._count_things())

    def infer(self) -> Inference | None:
        """What the views so far show; None while there is no view. Asked twice, the same."""
        if self._inference is None and self._stored:
            self._forget_inference()  # one that failed half way
            self._finish()
            joint = self._camera.with_objects()
            self._camera_only = self._camera.read_from(joint)
            self._scene, self._outcomes = Scene(), Counter(self._refused)
            self._start_back_end()
            with self._clock.stage("inference"):
                inference = self._infer_volumes()
            with self._clock.stage("joint estimate"):
                self._estimate_jointly(inference)
            self._inference = inference
        return self._inference

    def landmarks(self, include_retired: bool = False) -> tuple[Landmark, ...]:
        """As `SemanticMapper.landmarks`, after inference."""
        self.infer()
        return super().landmarks(include_retired)

    def object_map(self, include_doubtful: bool = False) -> ObjectMap:
        """As `SemanticMapper.object_map`, after inference."""
        self.infer()
        return super().object_map(include_doubtful)

    def statistics(self) -> dict[str, Any]:
        """As `SemanticMapper.statistics`, and `batch`: the numbers of the last inference."""
        numbers: dict[str, Any] = {"views": len(self._stored)}
        if self._inference is not None:
            numbers |= self._inference.summary()
        return {**super().statistics(), "batch": numbers}

    def _forget_inference(self) -> None:
        if self._camera_only is not None:
            self._camera.read_from(self._camera_only)
            self._outcomes = self._refused
        self._camera_only = self._inference = None

    def _views(self) -> list[View]:
        smoother = self._camera.smoother
        return [stored.at(smoother.pose(stored.keyframe), smoother.R_world_upright) for stored in self._stored]

    def _infer_volumes(self) -> Inference:
        assert self._model is not None and self._priors is not None
        detections = [stored.detections for stored in self._stored]
        return infer_volumes(self._views(), detections, self._model, self._priors, self.config)

    def _estimate_jointly(self, inference: Inference) -> None:
        """Every hypothesis becomes a landmark, and every view is observed once, all landmarks being there."""
        assert self._lifecycle is not None
        for volume in inference.volumes:
            self._add_landmark(volume)
        self._camera.smoother.update()
        for stored in self._stored:
            self._observe(stored)
        self._drop_unmeasured()
        self._date_landmarks()
        self._lifecycle.bring_up_to_date()
        self._lifecycle.merge(all_seen=True)
        self._lifecycle.retire()
        self._lifecycle.bring_up_to_date()

    def _add_landmark(self, volume: VolumeHypothesis) -> None:
        assert self._lifecycle is not None
        first = self._stored[0].frame.stamp
        place = volume.position, volume.log_size, volume.covariance
        self._lifecycle.add_landmark(*place, self._lifecycle.new_belief(), (first, first))

    def _drop_unmeasured(self) -> None:
        """What no detection was assigned to, when each may show one thing only, is nowhere in particular."""
        for number, landmark in list(self._scene.landmarks.items()):
            if landmark.measurements == 0:
                self._camera.smoother.retire(number)
                del self._scene.landmarks[number]
        self._outcomes[Outcome.PROMOTED] = len(self._scene.landmarks)

    def _date_landmarks(self) -> None:
        """When each was seen first: in the first of the views that support it."""
        stamps = {stored.keyframe: stored.frame.stamp for stored in self._stored}
        for landmark in self._scene.landmarks.values():
            landmark.first_seen = min((stamps[k] for k in landmark.supporting), default=landmark.first_seen)

    def _observe(self, stored: StoredView) -> None:
        """One view: visibility -> association -> factors -> smoothing -> class and existence."""
        assert self._lifecycle is not None and self._observer is not None
        smoother = self._camera.smoother
        view, lifted = stored.at(smoother.pose(stored.keyframe), smoother.R_world_upright), list(stored.detections)
        targets, visibility, _, assignment = self._associate(view, lifted)
        touched = self._observer.observe(view, lifted, assignment, targets, visibility)
        smoother.update()
        self._lifecycle.refresh(touched)
