"""The estimating part of the mapper on a stage: things of known shape before a wall, by true cameras."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rooms import KINECT, STEP, look_at

from thingmap.datasets.frame import Frame
from thingmap.detectors.detections import Detections
from thingmap.factors.evidence_model import EvidenceModel, generic_evidence_model
from thingmap.factors.existence import ExistenceModel
from thingmap.factors.size_prior import load_size_priors
from thingmap.factors.solid import project_solids
from thingmap.mapper.config import MapperConfig, TrackConfig
from thingmap.mapper.estimation.association import associate
from thingmap.mapper.estimation.evidence import Observer, class_evidence, score_evidence
from thingmap.mapper.estimation.lifecycle import Lifecycle
from thingmap.mapper.estimation.lifting import lift
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.estimation.scene import Scene
from thingmap.mapper.estimation.smoother import Smoother
from thingmap.mapper.estimation.view import View

# how evidence adds up in these tests, whatever is learned or tuned elsewhere
STATED = ExistenceModel(
    null_prior=0.5,
    object_rate=(4.0, 2.0),
    none_rate=(1.0, 5.0),
    score_correlation=0.5,
    steady_confusion=0.1,
    surface=0.5,
)
PATIENT = MapperConfig(tracks=TrackConfig(min_existence=2.0))  # candidates become landmarks by their hits alone


@dataclass(frozen=True)
class Thing:
    """What stands in a `Stage`: an ellipsoid; `scores` (K,) are the detector's, which may also miss it (None).

    `there` is False for what a detector sees where nothing is.
    """

    position: tuple[float, float, float]
    half_axes: tuple[float, float, float] = (0.1, 0.1, 0.1)
    scores: tuple[float, ...] | None = None
    there: bool = True


class Stage:
    """The estimating part of the mapper before a wall: true poses, exact boxes, a depth image of ellipsoids.

    One keyframe (`show`) goes through the same calls as in `SemanticMapper`. Cameras look along +y, 2 m off. Unless
    told otherwise it is `PATIENT`, so that three hits make a landmark.
    """

    CLASSES: tuple[str, ...] = ("cup", "bowl", "monitor")
    WALL = 4.0  # m behind the camera's place, along y

    def __init__(self, config: MapperConfig | None = None) -> None:
        self.config = config or PATIENT
        self.scene, self.outcomes = Scene(), Counter[Outcome]()
        self.smoother = Smoother(self.config.smoother, KINECT, self.config.up.upright_tolerance)
        generic = generic_evidence_model().bind(self.CLASSES)
        self.model = EvidenceModel(generic.scores, generic.detection, STATED, "the numbers of these tests")
        self.priors = load_size_priors(self.CLASSES)
        self.observer = Observer(self.scene, self.smoother, self.model, self.config.evidence, self.outcomes)
        members = self.scene, self.smoother, self.observer
        self.lifecycle = Lifecycle(*members, self.priors, self.model, self.config, self.outcomes)
        self._T: np.ndarray | None = None

    def view(self, x: float, *things: Thing, pull: float = 2.0) -> View:
        """A new keyframe from x metres to the right, `pull` metres before the things."""
        T = look_at((x, -pull, 0.0), (x, 1.0 - pull, 0.0))
        if self._T is None:
            self.smoother.add_first(T, np.full(6, 1e-3), np.array([0.0, 0.0, 1.0]), 0.01)
        else:
            self.smoother.add_keyframe(np.linalg.inv(self._T) @ T, STEP)
        self._T, t = T, self.smoother.keyframes - 1
        color = np.zeros((KINECT.height, KINECT.width, 3), dtype=np.uint8)
        frame = Frame(t, f"frame-{t:06d}", 0.1 * t, color, self._depth(T, things), KINECT)
        return View(frame, t, T, self.smoother.R_world_upright)

    def show(self, x: float, *things: Thing, pull: float = 2.0) -> View:
        """One keyframe, from the view to retirement."""
        view = self.view(x, *things, pull=pull)
        lifted, _ = lift(self.detect(view, things), view.frame, self.config.lifting)
        targets, visibility = self.scene.predict(view, self.config.association, self.config.evidence.occlusion)
        scores = score_evidence(lifted, self.model)
        evidence = class_evidence(scores, self.scene.members())
        camera = view.T_world_camera, view.R_world_upright
        assignment = associate(lifted, targets, evidence, *camera, self.config.association)
        touched = self.observer.observe(view, lifted, assignment, targets, visibility)
        self.lifecycle.start_tracks(view, lifted, scores, assignment)
        touched |= self.lifecycle.promote_and_drop()
        self.smoother.update()
        self.lifecycle.refresh(touched)
        self.lifecycle.merge()
        self.lifecycle.retire()
        return view

    def detect(self, view: View, things: Sequence[Thing]) -> Detections:
        """The boxes of the things that have scores, counted from the image's edges and clipped."""
        found = [thing for thing in things if thing.scores is not None]
        if not found:
            return Detections.empty(self.CLASSES)
        boxes = np.array([self._box(view.T_world_camera, thing) for thing in found]) + 0.5
        return Detections(self.CLASSES, boxes, np.array([t.scores for t in found])).clip(KINECT.width, KINECT.height)

    @staticmethod
    def _box(T: np.ndarray, thing: Thing) -> np.ndarray:
        place, size = np.array([thing.position]), np.log([thing.half_axes])
        return project_solids(T, np.eye(3), place, size, KINECT)[0][0]

    def _depth(self, T: np.ndarray, things: Sequence[Thing]) -> np.ndarray:
        """(H, W) float32: a wall, and what stands before it, by the rays' quadratic."""
        v, u = np.mgrid[0 : KINECT.height, 0 : KINECT.width]
        rays = np.stack([(u - KINECT.cx) / KINECT.fx, (v - KINECT.cy) / KINECT.fy, np.ones(u.shape)], axis=-1)
        depth = np.full(u.shape, self.WALL)
        for thing in things:
            if not thing.there:
                continue
            scale = T[:3, :3] / np.array(thing.half_axes)[:, None]
            d, o = rays @ scale.T, (T[:3, 3] - thing.position) / thing.half_axes
            a, b, c = (d * d).sum(-1), d @ o, o @ o - 1.0
            root = b * b - a * c
            depth = np.where(root > 0.0, np.minimum(depth, (-b - np.sqrt(np.maximum(root, 0.0))) / a), depth)
        return depth.astype(np.float32)
