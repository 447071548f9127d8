"""The back end alone: the mapper's own smoother, observer and lifecycle, driven by simulated views.

A keyframe goes through the same calls as in `SemanticMapper`; only what comes from images is simulated: odometry,
detections, visibility, and the association, which is known.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from weakref import WeakKeyDictionary

import numpy as np
from back_end_views import SimulatedView
from back_end_world import KINECT, UP, World, clip

from thingmap.datasets.frame import Frame
from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.factors.solid import project_solids
from thingmap.factors.visibility import Visibility, VolumePart
from thingmap.mapper.config import MapperConfig
from thingmap.mapper.estimation.association import Assignment, Targets
from thingmap.mapper.estimation.beliefs import Belief
from thingmap.mapper.estimation.evidence import Observer, score_evidence
from thingmap.mapper.estimation.lifecycle import Lifecycle
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.estimation.records import Up, Visual
from thingmap.mapper.estimation.scene import Scene
from thingmap.mapper.estimation.smoother import Smoother
from thingmap.mapper.estimation.view import View
from thingmap.mapper.trajectory.camera import GAUGE_SIGMAS

KEYFRAMES_PER_SECOND = 4.0


class CpuClock:
    """CPU milliseconds per keyframe, by stage."""

    def __init__(self) -> None:
        self.keyframes: list[dict[str, float]] = []

    def next_keyframe(self) -> None:
        self.keyframes.append(defaultdict(float))

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Adds the CPU time of the block to a stage of the keyframe at hand."""
        start = time.process_time()
        try:
            yield
        finally:
            self.keyframes[-1][name] += 1e3 * (time.process_time() - start)


class BackEnd:
    """The estimating part of `SemanticMapper` around a known association."""

    def __init__(self, world: World, config: MapperConfig | None = None) -> None:
        self.config = config or MapperConfig()
        self.clock = CpuClock()
        self.scene = Scene()
        self.smoother = Smoother(self.config.smoother, KINECT, self.config.up.upright_tolerance)
        self.outcomes: Counter[Outcome] = Counter()
        self.world = world
        self._model = generic_evidence_model().bind(world.priors.classes)
        self._observer = Observer(self.scene, self.smoother, self._model, self.config.evidence, self.outcomes)
        members = self.scene, self.smoother, self._observer
        self._lifecycle = Lifecycle(*members, world.priors, self._model, self.config, self.outcomes)
        self._thing_of: WeakKeyDictionary[Belief, int] = WeakKeyDictionary()  # a track's belief becomes its landmark's

    def thing_of(self, belief: Belief) -> int:
        """The true thing that a member of the scene stands for."""
        return self._thing_of[belief]

    def add(self, simulated: SimulatedView) -> None:
        """One keyframe, as `SemanticMapper._map` does it."""
        stage, lifecycle = self.clock.stage, self._lifecycle
        self.clock.next_keyframe()
        with stage("odometry"):
            view = self._add_camera(simulated)
        things = list(simulated.detections)
        lifted = list(simulated.detections.values())
        targets, visibility = self._predict(view, simulated)
        assignment = self._assign(things)
        with stage("factors"):
            scores = score_evidence(lifted, self._model)
            touched = self._observer.observe(view, lifted, assignment, targets, visibility)
            before = len(self.scene.tracks)
            lifecycle.start_tracks(view, lifted, scores, assignment)
        started = (thing for thing, target in zip(things, assignment.target, strict=True) if target < 0)
        for track, thing in zip(self.scene.tracks[before:], started, strict=True):
            self._thing_of[track.belief] = thing
        with stage("factors"):
            promoted = lifecycle.promote_and_drop()
        with stage("smoothing"):
            self.smoother.update()
        with stage("beliefs"):
            lifecycle.refresh(touched | promoted)
        with stage("lifecycle"):
            if promoted or view.keyframe % self.config.lifecycle.merge_every == 0:
                lifecycle.merge()
            lifecycle.retire()

    def finish(self) -> None:
        """Brings every landmark up to date, as `SemanticMapper.object_map` does."""
        self._lifecycle.bring_up_to_date()

    def _add_camera(self, simulated: SimulatedView) -> View:
        smoother, t = self.smoother, simulated.keyframe
        if simulated.odometry is None:
            T = simulated.T_world_camera
            smoother.add_first(T, GAUGE_SIGMAS, UP, self.config.up.prior_sigma)
        else:
            motion = simulated.odometry
            T = smoother.pose(motion.a) @ motion.T_a_b
            smoother.add_keyframe(motion.T_a_b, motion.covariance)
        for motion in simulated.visual:
            smoother.add(Visual(motion.a, t, motion.T_a_b, motion.covariance))
        if simulated.up is not None:
            smoother.add(Up(t, simulated.up, self.config.up.plane_sigma))
        nothing = np.empty((0, 0))
        frame = Frame(t, f"view-{t:06d}", t / KEYFRAMES_PER_SECOND, nothing, nothing, KINECT)
        return View(frame, t, T, smoother.R_world_upright)

    def _predict(self, view: View, simulated: SimulatedView) -> tuple[Targets, Visibility]:
        """As `Scene.predict`, with the truth in place of the depth image."""
        members = self.scene.members()
        own = np.array([self._thing_of[m.belief] for m in members], dtype=int)
        positions = np.array([m.position for m in members]).reshape(-1, 3)
        log_sizes = np.array([m.log_size for m in members]).reshape(-1, 3)
        covariances = np.array([m.covariance for m in members]).reshape(-1, 3, 3)
        xyxy, _ = project_solids(view.T_world_camera, view.R_world_upright, positions, log_sizes, KINECT)
        occluded, in_image, free = simulated.occluded[own], simulated.in_image[own], self.world.free[own]
        shares = {
            "occluded": occluded,
            "agreeing": (1.0 - occluded) * (1.0 - free),
            "free": (1.0 - occluded) * free,
            "missing": np.zeros(len(own)),
            "in_image": in_image,
        }
        columns = {name: np.repeat(share[:, None], len(VolumePart), axis=1) for name, share in shares.items()}
        pixels = (clip(xyxy)[:, 2:] - clip(xyxy)[:, :2]).prod(axis=1)
        targets = Targets(positions, covariances, log_sizes, clip(xyxy), in_image * (1.0 - occluded))
        return targets, Visibility(**columns, pixels=pixels)

    def _assign(self, things: list[int]) -> Assignment:
        target_of = {self._thing_of[m.belief]: i for i, m in enumerate(self.scene.members())}
        target = np.array([target_of.get(thing, -1) for thing in things], dtype=int)
        return Assignment(target, np.full(len(things), -1))
