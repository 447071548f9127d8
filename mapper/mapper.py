"""The mapper: frames go in one by one, the map can be read at any time."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..datasets.errors import UserError
from ..datasets.frame import Frame
from ..detectors.detections import Detections
from ..detectors.detector import Detector
from ..factors.evidence_model import (
    EvidenceModel,
    default_evidence_model,
)
from ..factors.score_model import ScoreEvidence
from ..factors.size_prior import ClassSizePriors, load_size_priors
from ..factors.visibility import Visibility
from .config import MapperConfig
from .estimation.association import Assignment, Targets, associate
from .estimation.corrections import Followers
from .estimation.evidence import Observer, class_evidence, score_evidence
from .estimation.landmarks import Landmark
from .estimation.lifecycle import Lifecycle
from .estimation.lifting import LiftedDetection, lift
from .estimation.outcomes import Outcome
from .estimation.scene import Scene
from .estimation.view import View
from .evidence_choice import evidence_model, with_evidence_of
from .glimpse import Glimpse
from .map.compose import compose_things
from .map.object_map import ObjectMap
from .queries.answer import PROBABLE
from .stages import StageClock
from .trajectory.camera import CameraGraph
from .trajectory.cloud import KeyframeCloud
from .trajectory.constellation.recognition import same_places


@dataclass(frozen=True, slots=True, eq=False)
class MapUpdate:
    """What a frame did.

    Attributes:
        frame_index: of the frame.
        is_keyframe: whether it entered the graph.
        T_world_camera: (4, 4) its pose as estimated now.
        things: number of landmarks that are probably objects.
    """

    frame_index: int
    is_keyframe: bool
    T_world_camera: np.ndarray
    things: int


class SemanticMapper:
    """Maps things from RGB-D frames and a detector's boxes.

    Args:
        detector: called on keyframes; may be None when `process_frame` is given detections.
        config: every number of the mapper.
        source: name of what is mapped, kept in the map.
        gravity: (3,) unit vector pointing down in the dataset's world, where known; used with the dataset's poses.
        model: what is known of the detector; by default the one that the configuration names, else the detector
            (`evidence_model`), else the shipped one for a detector of its classes and the generic one for others
            (`default_evidence_model`).
    """

    def __init__(
        self,
        detector: Detector | None = None,
        config: MapperConfig | None = None,
        *,
        source: str = "",
        gravity: np.ndarray | None = None,
        model: EvidenceModel | None = None,
    ) -> None:
        self.config = with_evidence_of(detector, config or MapperConfig())
        self._detector, self._source = detector, source
        self._learned = model or evidence_model(self.config.evidence.model)  # None: by the classes
        self._camera = CameraGraph(self.config, gravity)
        self._cloud = KeyframeCloud(self.config.cloud)
        self._scene = Scene()
        self._outcomes: Counter[Outcome] = Counter()
        self._clock = StageClock()
        self._classes: tuple[str, ...] | None = None
        self._priors: ClassSizePriors | None = None
        self._lifecycle: Lifecycle | None = None
        self._observer: Observer | None = None
        self._followers: Followers | None = None
        self._model: EvidenceModel | None = None
        self._embedding_length: int | None = None
        self._detected: tuple[int, Detections] | None = None  # of the last frame with detections, for `glimpse`

    def process_frame(self, frame: Frame, detections: Detections | None = None) -> MapUpdate:
        """Adds one frame.

        Args:
            frame: the next image.
            detections: of this frame; without them the detector is asked, on keyframes only.

        Raises:
            BrokenFrame: where the frame cannot be registered; the map stays as it was.
            UserError: where detections name other classes than before, or there is no detector.
        """
        with self._clock.stage("odometry"):
            is_keyframe = self._camera.track(frame)
        if is_keyframe:
            # before the graph changes: whatever a detector raises, the map stays whole
            with self._clock.stage("detection"):
                found = self._detect(frame, detections)
            with self._clock.stage("keyframe"):
                view = self._camera.add_keyframe(frame)
            self._map(view, self._lift(found, frame))
            with self._clock.stage("links"):
                self._camera.match_keyframe()
                self._recognise_things(view.keyframe)
            with self._clock.stage("cloud"):
                self._cloud.add(frame, view.keyframe, self._camera.smoother.pose(view.keyframe))
        return MapUpdate(frame.index, is_keyframe, self._camera.pose(), self._count_things())

    def _map(self, view: View, lifted: list[LiftedDetection]) -> None:
        """One keyframe: visibility -> association -> factors -> smoothing -> class and existence -> lifecycle."""
        stage = self._clock.stage
        assert self._lifecycle is not None and self._observer is not None
        lifecycle, observer = self._lifecycle, self._observer
        if not view.placed:
            self._outcomes[Outcome.ADRIFT] += len(lifted)
            return self._solve()
        targets, visibility, scores, assignment = self._associate(view, lifted)
        with stage("factors"):
            touched = observer.observe(view, lifted, assignment, targets, visibility)
            lifecycle.start_tracks(view, lifted, scores, assignment)
            promoted = lifecycle.promote_and_drop()
        self._solve()
        with stage("beliefs"):
            lifecycle.refresh(touched | promoted)
        with stage("lifecycle"):
            if promoted or view.keyframe % self.config.lifecycle.merge_every == 0:
                lifecycle.merge()
            lifecycle.retire()

    def _recognise_things(self, keyframe: int) -> None:
        """From time to time: whether the things mapped lately lie as some did that were mapped long ago."""
        loops = self.config.loops
        if loops.constellation and keyframe % loops.constellation_every == 0 and self._camera.seeks_loops:
            landmarks, smoother = self._scene.landmarks.values(), self._camera.smoother
            self._camera.propose_loops(same_places(landmarks, keyframe, smoother, self.config.constellation))

    def _solve(self) -> None:
        """The graph with all that is new; what is not in it follows where poses were corrected."""
        assert self._followers is not None
        smoother = self._camera.smoother
        with self._clock.stage("smoothing"):
            smoother.update()
        with self._clock.stage("corrections"):
            if self._followers.follow():
                self._cloud.rebuild(smoother.poses())

    def _finish(self) -> None:
        """Everything that is still being worked on enters the map, for its reader; a second time changes nothing."""
        if not self._camera.started:
            return
        self._camera.finish()
        if self._followers is None:
            self._camera.smoother.settle()
        elif self._camera.smoother.is_pending:
            self._solve()

    def _associate(
        self, view: View, lifted: list[LiftedDetection]
    ) -> tuple[Targets, Visibility, list[ScoreEvidence], Assignment]:
        """What a view should show, how much of it is visible, what its scores say, and which detection shows what."""
        config, scene, stage = self.config, self._scene, self._clock.stage
        assert self._model is not None
        with stage("visibility"):
            targets, visibility = scene.predict(view, config.association, config.evidence.occlusion)
        with stage("association"):
            scores = score_evidence(lifted, self._model)
            evidence = class_evidence(scores, scene.members())
            camera = view.T_world_camera, view.R_world_upright
            assignment = associate(lifted, targets, evidence, *camera, config.association)
        return targets, visibility, scores, assignment

    def landmarks(self, include_retired: bool = False) -> tuple[Landmark, ...]:
        """Landmarks as estimated now, for those who want to know more of them than a map tells."""
        self._finish()
        if self._lifecycle is not None:
            self._lifecycle.bring_up_to_date()
        retired = self._scene.retired.values() if include_retired else ()
        return (*self._scene.landmarks.values(), *retired)

    def object_map(self, include_doubtful: bool = False) -> ObjectMap:
        """The map as estimated now; `include_doubtful` adds what exists with less than 0.5 and what was retired."""
        landmarks = self.landmarks(include_retired=include_doubtful)
        things = compose_things(landmarks, self._classes or (), 0.0 if include_doubtful else PROBABLE)
        return ObjectMap(
            things=things,
            classes=self._classes or (),
            source=self._source,
            frame=self._camera.map_frame,
            up=self._camera.up(),
            camera=self._camera.intrinsics if self._camera.started else None,
        )

    def trajectory(self) -> tuple[np.ndarray, np.ndarray]:
        """(N,) stamps and (N, 4, 4) `T_world_camera` of every processed frame, as estimated now."""
        self._finish()
        return self._camera.trajectory()

    def keyframes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(M,) stamps, (M, 4, 4) `T_world_camera` of the keyframes and (M, 6, 6) covariances (right tangent, rad, m).

        Covariances are relative to the first camera, which defines the world.
        """
        self._finish()
        return self._camera.keyframes()

    def relative_covariance(self, a: int, b: int) -> np.ndarray:
        """(6, 6) covariance of keyframe b as seen from keyframe a, in the right tangent of `T_a_b` [rad, m]."""
        self._finish()
        return self._camera.smoother.pose_difference_covariance(a, b)

    def cloud(self) -> tuple[np.ndarray, np.ndarray]:
        """(M, 3) float32 points, world, metres, and (M, 3) uint8 RGB, one a voxel."""
        self._finish()
        poses = self._camera.smoother.poses() if self._camera.started else np.empty((0, 4, 4))
        return self._cloud.assemble(poses)

    def statistics(self) -> dict[str, Any]:
        """Stage timings, outcome counts, sizes of the graph; JSON-able."""
        smoother = self._camera.smoother if self._camera.started else None
        return {
            "keyframes": smoother.keyframes if smoother else 0,
            "landmarks": len(self._scene.landmarks),
            "candidates": len(self._scene.tracks),
            "retired": len(self._scene.retired),
            "graph_rebuilds": smoother.rebuilds if smoother else 0,
            "ledger_records": len(smoother.ledger) if smoother else 0,
            "evidence_model": self._model.learned_from if self._model else "none was needed",
            **self._camera.statistics(),
            "outcomes": {outcome.name.lower(): self._outcomes[outcome] for outcome in Outcome},
            "stages": self._clock.summary(),
        }

    def glimpse(self) -> Glimpse | None:
        """What is known between two frames, for a live view; None before the first frame."""
        if not self._camera.started:
            return None
        smoother = self._camera.smoother
        return Glimpse(
            T_world_keyframe=smoother.poses(),
            loops=np.array([(loop.a, loop.b) for loop in smoother.loops().values()], dtype=np.int64).reshape(-1, 2),
            R_world_upright=smoother.R_world_upright,
            landmarks=tuple(self._scene.landmarks.values()),
            candidates=len(self._scene.tracks),
            classes=self._classes or (),
            detected=self._detected,
            stages=self._clock.latest(),
        )

    def save_ledger(self, path: Path) -> None:
        """Writes every measurement, from which the graph can be rebuilt (`Ledger.load`)."""
        if self._camera.started:
            k = self._camera.intrinsics
            self._camera.smoother.ledger.save(path, {"intrinsics": asdict(k), "classes": list(self._classes or ())})

    def _detect(self, frame: Frame, detections: Detections | None) -> Detections:
        if detections is None and not frame.has_image:
            detections = Detections.empty(self._classes or ())
        if detections is None:
            if self._detector is None:
                raise UserError("no detections: give the mapper a detector, or process_frame the frame's detections")
            detections = self._detector(frame)
        if self._priors is None:
            extra = Path(self.config.class_sizes) if self.config.class_sizes else None
            self._classes = tuple(detections.classes)
            self._model = (self._learned or default_evidence_model(self._classes)).bind(self._classes)
            self._priors = load_size_priors(self._classes, extra, self._model.background_size)
        if self._classes is not None and tuple(detections.classes) != self._classes:
            raise UserError(
                f"frame {frame.name}: expected detections over the same {len(self._classes)} classes as before, found "
                f"{len(detections.classes)} classes; use one detector for a map"
            )
        self._check_embeddings(frame, detections)
        self._detected = frame.index, detections
        return detections

    def _check_embeddings(self, frame: Frame, detections: Detections) -> None:
        if detections.embedding is None or len(detections) == 0:
            return
        length = detections.embedding.shape[1]
        if self._embedding_length not in (None, length):
            raise UserError(
                f"frame {frame.name}: expected embeddings of {self._embedding_length} numbers as before, found "
                f"{length}; use one detector for a map"
            )
        self._embedding_length = length

    def _lift(self, detections: Detections, frame: Frame) -> list[LiftedDetection]:
        if self._lifecycle is None:
            self._start_back_end()
        lifted, refused = lift(detections, frame, self.config.lifting, self.config.evidence.parts)
        self._outcomes.update(refused)
        return lifted

    def _start_back_end(self) -> None:
        smoother, priors, model = self._camera.smoother, self._priors, self._model
        assert priors is not None and model is not None
        self._observer = Observer(self._scene, smoother, model, self.config.evidence, self._outcomes)
        members = self._scene, smoother, self._observer
        self._lifecycle = Lifecycle(*members, priors, model, self.config, self._outcomes)
        self._followers = Followers(self._scene, smoother, self._lifecycle, self.config.tracks, self.config.corrections)

    def _count_things(self) -> int:
        return sum(landmark.belief.existence >= PROBABLE for landmark in self._scene.landmarks.values())
