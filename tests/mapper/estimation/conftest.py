"""Rooms of known cameras and objects, and the same graphs solved by other means."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L, S, X

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.detectors.detections import Detections
from thingmap.factors.evidence_model import EvidenceModel, generic_evidence_model
from thingmap.factors.existence import ExistenceModel
from thingmap.factors.odometry import pose3
from thingmap.factors.size_prior import ClassSizePriors, load_size_priors
from thingmap.factors.solid import project_solids
from thingmap.mapper.config import MapperConfig, SmootherConfig, TrackConfig
from thingmap.mapper.estimation.association import associate
from thingmap.mapper.estimation.evidence import Observer, class_evidence, score_evidence
from thingmap.mapper.estimation.lifecycle import Lifecycle
from thingmap.mapper.estimation.lifting import lift
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.estimation.record_factors import UP, FactorContext, record_factors, site_factor
from thingmap.mapper.estimation.records import Box, DepthCentre, NewLandmark
from thingmap.mapper.estimation.scene import Scene
from thingmap.mapper.estimation.size_site import SizeSite
from thingmap.mapper.estimation.smoother import Smoother
from thingmap.mapper.estimation.view import View

KINECT = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
EXACT = SmootherConfig(
    relinearize_skip=1,
    threshold_rotation=1e-6,
    threshold_translation=1e-6,
    threshold_position=1e-6,
    threshold_size=1e-6,
    threshold_up=1e-6,
)
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
STEP = np.diag(np.repeat([0.005**2, 0.01**2], 3))  # covariance of a step of odometry, rad^2 and m^2
Factors = list[gtsam.NonlinearFactor]


def look_at(position: Sequence[float], target: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """(4, 4) `T_world_camera` of an upright camera; the world's z is up."""
    forward = np.subtract(target, position) / np.linalg.norm(np.subtract(target, position))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    T[:3, 3] = position
    return T


class Room:
    """A smoother that is told what true cameras see of true objects.

    Attributes:
        smoother: what is tested; `EXACT` thresholds unless told otherwise.
        cameras: (4, 4) true `T_world_camera`, by keyframe.
        objects: landmark -> true (3,) position and (3,) log half-axes.
    """

    def __init__(self, config: SmootherConfig = EXACT, up_sigma: float = 0.01, tolerance: float = 0.026) -> None:
        self.smoother = Smoother(config, KINECT, tolerance)
        self.cameras: list[np.ndarray] = []
        self.objects: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._up_sigma = up_sigma

    def add_camera(self, T: np.ndarray, error: np.ndarray | None = None, covariance: np.ndarray = STEP) -> int:
        """The next keyframe; its odometry is off by the (6,) tangent `error`."""
        if self.cameras:
            self.smoother.update()
            motion = pose3(np.linalg.inv(self.cameras[-1]) @ T).retract(np.zeros(6) if error is None else error)
            self.smoother.add_keyframe(motion.matrix(), covariance)
        else:
            self.smoother.add_first(T, np.full(6, 1e-3), np.array([0.0, 0.0, 1.0]), self._up_sigma)
        self.cameras.append(T)
        return len(self.cameras) - 1

    def add_object(
        self, number: int, position: Sequence[float], half_axes: Sequence[float], site: SizeSite | None = None
    ) -> None:
        """A landmark that starts 2 cm and 0.1 log units off."""
        place, log_size = np.array(position, dtype=float), np.log(half_axes)
        self.objects[number] = place, log_size
        own = SizeSite(log_size, 4.0 * np.eye(3)) if site is None else site
        self.smoother.add_landmark(number, place + 0.02, log_size + 0.1, own)

    def see(self, keyframe: int, number: int, sigma_px: float = 2.0, sides: np.ndarray | None = None) -> None:
        """An exact measurement of an object, or one whose box `sides` are off by (4,) pixels."""
        self.see_centre(keyframe, number)
        self.see_box(keyframe, number, sigma_px, sides)

    def see_centre(self, keyframe: int, number: int) -> None:
        """The exact centre from depth, known to 2 cm across and 5 cm along the ray."""
        T, (position, _) = self.cameras[keyframe], self.objects[number]
        self.smoother.add(DepthCentre(keyframe, number, T[:3, :3].T @ (position - T[:3, 3]), 0.02, 0.05, 1.0))

    def see_box(self, keyframe: int, number: int, sigma_px: float = 2.0, sides: np.ndarray | None = None) -> None:
        """The exact box, or one whose `sides` are off by (4,) pixels."""
        position, log_size = self.objects[number]
        box = project_solids(self.cameras[keyframe], np.eye(3), position[None], log_size[None], KINECT)[0][0]
        box = box if sides is None else box + sides
        self.smoother.add(Box(keyframe, number, box, np.ones(4, bool), sigma_px))

    @classmethod
    def seen_from(cls, positions: Sequence[Sequence[float]], *objects: Sequence[float], **kwargs) -> Room:
        """Objects 1, 2, ... of half-axes 0.1, 0.15, 0.2 m, each seen exactly from every camera position, and solved."""
        room = cls(**kwargs)
        for position in positions:
            room.add_camera(look_at(position))
        for number, place in enumerate(objects, 1):
            room.add_object(number, place, (0.1, 0.15, 0.2))
            for keyframe in range(len(positions)):
                room.see(keyframe, number)
        room.smoother.update()
        return room


def ledger_factors(smoother: Smoother) -> Factors:
    """The factors of every record that counts, sites left out, made anew from the ledger."""
    context = FactorContext(EXACT, KINECT, smoother.R_world_upright, smoother.owner)
    factors: Factors = []
    for record in smoother.ledger:
        if isinstance(record, NewLandmark) and record.landmark not in smoother.sites:
            continue
        if isinstance(record, DepthCentre | Box) and smoother.owner(record.landmark) not in smoother.sites:
            continue
        factors += record_factors(record, context)
    return factors


def estimate(smoother: Smoother) -> gtsam.Values:
    """What the smoother says, as values to start a batch solver from."""
    values = gtsam.Values()
    for t, T in enumerate(smoother.poses()):
        values.insert(X(t), pose3(T))
    values.insert(UP, gtsam.Unit3(smoother.up()[0]))
    for j in smoother.sites:
        values.insertPoint3(L(j), smoother.position(j))
        values.insert(S(j), smoother.log_size(j))
    return values


def optimise(factors: Factors, start: gtsam.Values) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """Levenberg-Marquardt to the last digit."""
    graph = gtsam.NonlinearFactorGraph()
    for factor in factors:
        graph.add(factor)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-13)
    parameters.setAbsoluteErrorTol(1e-13)
    parameters.setMaxIterations(300)
    return graph, gtsam.LevenbergMarquardtOptimizer(graph, start, parameters).optimize()


def solve_batch(smoother: Smoother) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """The smoother's whole graph, from its ledger and its sites, solved at once."""
    sites = [site_factor(j, site) for j, site in smoother.sites.items()]
    return optimise(ledger_factors(smoother) + sites, estimate(smoother))


def make_priors(means: np.ndarray, sigmas: np.ndarray | Sequence[float]) -> ClassSizePriors:
    """`means` (K + 1, 3), first "not an object"; `sigmas` (K + 1,) or (K + 1, 3) log units.

    Anything is like no object.
    """
    means, sigmas = np.asarray(means, dtype=float), np.asarray(sigmas, dtype=float)
    spread = np.broadcast_to(sigmas.reshape(len(means), -1), means.shape)
    names, covariances = tuple("abcdefgh"[: len(means) - 1]), np.array([np.diag(row**2) for row in spread])
    rows = [*range(len(means)), 0]
    return ClassSizePriors(names, means[rows], covariances[rows], np.ones(len(names), bool))


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

    CLASSES = ("cup", "bowl", "monitor")
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


class Tools:
    """What the tests share; a class, so that it needs no import."""

    kinect = KINECT
    patient = PATIENT
    exact = EXACT
    Room = Room
    Stage = Stage
    Thing = Thing
    look_at = staticmethod(look_at)
    ledger_factors = staticmethod(ledger_factors)
    estimate = staticmethod(estimate)
    optimise = staticmethod(optimise)
    solve_batch = staticmethod(solve_batch)
    make_priors = staticmethod(make_priors)


@pytest.fixture(scope="session")
def tools() -> type[Tools]:
    """`Room`, `look_at`, `solve_batch` and the like."""
    return Tools


@pytest.fixture
def two_views() -> Callable[..., Room]:
    """`two_views(*objects, **kwargs)`: two cameras at 2 m, 40 degrees apart, looking at the origin."""

    def make(*objects: Sequence[float], **kwargs) -> Room:
        return Room.seen_from([(2.0, 0.0, 0.3), (1.5, 1.3, 0.3)], *(objects or [(0.0, 0.0, 0.0)]), **kwargs)

    return make
