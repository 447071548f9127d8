"""The camera's part of the graph: keyframe poses, odometry between them, and the up direction."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np

from ...datasets.frame import BrokenFrame, Frame, FrameProblem
from ..config import MapperConfig, OdometrySource
from ..estimation.records import Up, Visual
from ..estimation.smoother import Smoother
from ..estimation.view import View
from ..map.object_map import MapFrame
from ..map.up_direction import UpDirection
from ..map.upright import upright_rotation
from .constellation.candidates import LoopCandidate
from .depth_points import DepthPoints
from .keyframes import FrameTrajectory, KeyframeSelector
from .known_place import KnownPlace
from .loops.loop_closer import LoopCloser
from .odometry.odometry import OdometryStep, Tracking, TrackingOutcome, fused, widened
from .odometry.sources import make_odometry
from .rigid import chi_square, inverse
from .sparse_frames import SparseFrames
from .up import UpMeasurement, camera_prior, from_accelerometer, from_planes, scanner_prior
from .visual.features import FeatureExtractor, Features
from .visual.hybrid_links import HybridLinks
from .visual.visual_odometry import VisualEdge, VisualOdometry

UP_SOURCES = ("gravity file", "accelerometer", "planes", "LiDAR axis", "camera prior")  # the best first
REGISTERING = (OdometrySource.KISS_ICP, OdometrySource.SMALL_GICP)  # depth images; other sources state their noise
GAUGE_SIGMAS = np.repeat([1e-3, 1e-3], 3)  # rad, m: the first camera defines the world


class CameraGraph:
    """Tracks every frame; puts keyframes, and what they say about up, into the smoother.

    Args:
        config: of the whole mapper.
        gravity: (3,) unit vector pointing down in the dataset's world; only of use with the dataset's poses.
    """

    def __init__(self, config: MapperConfig, gravity: np.ndarray | None) -> None:
        self._config = config
        given = config.odometry.source is OdometrySource.POSES
        self._gravity = gravity if given else None
        self.map_frame = MapFrame.DATASET if given else MapFrame.FIRST_CAMERA
        self._odometry = make_odometry(config.odometry)
        self._extract = FeatureExtractor(config.visual)
        self._sparse = SparseFrames(config.sparse)
        looks = config.visual.enabled and not given
        self._visual = VisualOdometry(config.visual, config.seed, config.sparse.neighbours) if looks else None
        self._points = DepthPoints(config.odometry.pixel_step, config.odometry.min_range, config.odometry.max_range)
        self._selector = KeyframeSelector(config.keyframes)
        self._frames = FrameTrajectory()
        self._place = KnownPlace(config.loops)
        self._loops: LoopCloser | None = None
        self._hybrid: HybridLinks | None = None
        self._T_last_now: np.ndarray | None = None  # between the last two keyframes, as measured
        self._unmatched: tuple[int, Features, np.ndarray] | None = None  # the latest keyframe, until it is solved
        self._tracking = Tracking(np.eye(4), TrackingOutcome.GOOD)
        self._jumped = False  # whether the last frame is the first that is LOST
        self._T_keyframe_camera = np.eye(4)
        self.tracked: Counter[TrackingOutcome] = Counter()  # frames by outcome
        self._up_sources: set[str] = set()
        self._smoother: Smoother | None = None

    @property
    def started(self) -> bool:
        """Whether there is a keyframe."""
        return self._smoother is not None

    @property
    def smoother(self) -> Smoother:
        """The graph.

        Raises:
            RuntimeError: before the first frame.
        """
        if self._smoother is None:
            raise RuntimeError("no frame has been processed yet")
        return self._smoother

    def track(self, frame: Frame) -> bool:
        """Registers a frame; True where it is to become a keyframe (`add_keyframe`).

        Raises:
            BrokenFrame: where it cannot be registered, or is of another camera; nothing has changed then.
        """
        if self.started and frame.intrinsics != self.intrinsics:
            raise BrokenFrame(frame.name, FrameProblem.OTHER_CAMERA)
        if not self.started:
            self._odometry = make_odometry(self._config.odometry, frame.scan is not None)
        if self._config.odometry.source in REGISTERING:
            self._sparse.see(frame.stamp)
        was_lost = self._tracking.outcome is TrackingOutcome.LOST
        self._tracking = self._odometry.register(frame)
        self._jumped = self._tracking.outcome is TrackingOutcome.LOST and not was_lost
        self.tracked[self._tracking.outcome] += 1
        T = self._tracking.T_odometry_camera
        wanted = self._selector.is_keyframe(T, self._tracking.outcome, every=self._sparse.doubtful)
        if wanted or not self.started:
            return True
        self._T_keyframe_camera = self._frames.append(frame.stamp, T, self.smoother.keyframes - 1, False)
        return False

    def add_keyframe(self, frame: Frame) -> View:
        """Puts the tracked frame into the graph: odometry, motion by features, links that are due, and up.

        To be followed by `smoother.update()`, and then by `match_keyframe`.
        """
        self._collect()
        step = self._odometry.keyframe()
        features = self._extract(frame) if frame.has_image and frame.scan is None else None
        if step is None:
            T_world_camera, number = self._start(frame), 0
        else:
            T_world_camera, number = self._go_on(step, features)
        if self._hybrid is not None:
            # from afar it ends anywhere: of 23 motions over 0.2 m before a cabinet, 5 were off by 40 to 110 mrad
            degenerate = self._tracking.outcome is TrackingOutcome.DEGENERATE and not self._sparse.doubtful
            self._hybrid.add_keyframe(number, frame, self._T_last_now, degenerate)
        if self._visual is not None and features is not None:
            self._visual.remember(number, features)
        self._T_keyframe_camera = self._frames.append(
            frame.stamp, self._tracking.T_odometry_camera, number, is_keyframe=True, is_jump=self._jumped
        )
        self._measure_up(frame, number, T_world_camera)
        if self._loops is not None and features is not None:
            self._unmatched = number, features, self._points(frame)
        return View(frame, number, T_world_camera, self.smoother.R_world_upright, self._place.is_known)

    def match_keyframe(self) -> None:
        """Has the latest keyframe, now solved, matched with others; what comes of it enters the graph later."""
        if self._unmatched is not None and self._loops is not None:
            number, features, points = self._unmatched
            self._loops.add_keyframe(number, features, points, adrift=not self._place.is_known)
            self._unmatched = None

    @property
    def seeks_loops(self) -> bool:
        """Whether the camera has not been tied to a place of long ago lately."""
        return self._loops is not None and not self._loops.has_old_links(self.smoother.keyframes - 1)

    def propose_loops(self, candidates: Iterable[LoopCandidate]) -> None:
        """Has keyframes matched that saw the same things."""
        if self._loops is not None:
            self._loops.propose(self.smoother.keyframes - 1, candidates)

    def finish(self) -> None:
        """Puts all links that are still being looked for into the graph."""
        if self._loops is not None:
            self._loops.finish(self.smoother.keyframes - 1)
        if self._hybrid is not None:
            self._hybrid.finish()

    def _collect(self) -> None:
        """Puts links that are due into the graph."""
        adrift = not self._place.is_known
        if self._loops is not None and self._loops.collect(self.smoother.keyframes, adrift) and adrift:
            self.smoother.settle()  # the next keyframe goes on from the place that was recognised
        if self._hybrid is not None:
            self._hybrid.collect(self.smoother.keyframes)

    def _go_on(self, step: OdometryStep, features: Features | None) -> tuple[np.ndarray, int]:
        """The next keyframe, from the last one by odometry and by features; its (4, 4) pose and its number."""
        last = self.smoother.keyframes - 1
        edges = self._edges(features)
        seen = [edge.motion for edge in edges if edge.a == last]
        motion, missing = step.T_a_b, self._sparse.missing()
        if seen:
            self._sparse.compare(step.T_a_b, step.covariance, seen[0].T_a_b, seen[0].covariance)
            missing = self._sparse.missing()
            # a local model that was bent where geometry is weak snaps back when it meets a corner
            other = seen[0].T_a_b, seen[0].covariance + missing
            step_covariance = step.covariance + self._sparse.missing_of_step()
            step_covariance = widened(step.T_a_b, step_covariance, *other, self._config.visual.gate)
            motion, covariance = fused(step.T_a_b, step_covariance, *other)
        else:
            step_covariance = covariance = step.covariance + self._sparse.missing_of_step()
        self._T_last_now, T_world_camera = motion, self.smoother.pose(last) @ motion
        self._place.step(last + 1, covariance)
        number = self.smoother.add_keyframe(step.T_a_b, step_covariance, T_world_camera)
        for edge in edges:
            if edge.a == last or self._agrees(edge, missing + covariance, T_world_camera):
                self.smoother.add(Visual(edge.a, number, edge.motion.T_a_b, edge.motion.covariance + missing))
        return T_world_camera, number

    def _edges(self, features: Features | None) -> list[VisualEdge]:
        """Motions from the last keyframes by features: from more of them where frames are far apart."""
        if self._visual is None or features is None:
            return []
        return self._visual.edges(features, self._config.sparse.neighbours if self._sparse.doubtful else None)

    def _agrees(self, edge: VisualEdge, covariance: np.ndarray, T_world_camera: np.ndarray) -> bool:
        """Whether a motion by features from before the last keyframe leads about where the last one does, (4, 4).

        Args:
            covariance: (6, 6) of that, and of what the edge lacks.
        """
        T_estimated = inverse(self.smoother.pose(edge.a)) @ T_world_camera
        squared = chi_square(edge.motion.T_a_b, T_estimated, covariance + edge.motion.covariance)
        return squared < self._config.visual.gate

    def pose(self) -> np.ndarray:
        """(4, 4) `T_world_camera` of the last frame, as estimated now."""
        return self.smoother.pose(self.smoother.keyframes - 1) @ self._T_keyframe_camera

    def trajectory(self) -> tuple[np.ndarray, np.ndarray]:
        """(N,) stamps and (N, 4, 4) `T_world_camera` of every frame, as estimated now."""
        return self._frames.poses(self.smoother.poses()) if self.started else self._frames.poses(np.empty((0, 4, 4)))

    def keyframes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(M,) stamps, (M, 4, 4) `T_world_camera` and (M, 6, 6) covariances of the keyframes, as estimated now."""
        if not self.started:
            return np.empty(0), np.empty((0, 4, 4)), np.empty((0, 6, 6))
        self.smoother.settle()
        return self._frames.keyframe_stamps(), self.smoother.poses(), self.smoother.pose_covariances()

    def statistics(self) -> dict[str, Any]:
        """Frames by tracking outcome, times the place was lost and found, links by kind; JSON-able."""
        tracking = {outcome.value: self.tracked[outcome] for outcome in TrackingOutcome}
        place = self._place
        return {
            "tracking": tracking,
            "place": {"lost": place.lost, "found": place.found, "given_up": place.given_up},
            "links": self._link_statistics(),
        }

    def _link_statistics(self) -> dict[str, Any]:
        statistics: dict[str, Any] = dict(self._loops.statistics()) if self._loops is not None else {}
        if self._hybrid is not None:
            statistics |= dict(sorted(self._hybrid.outcomes.items()))
            if self._hybrid.unavailable:
                statistics["whole image, why unavailable"] = self._hybrid.unavailable
        return statistics

    def up(self) -> UpDirection:
        """The world's up direction with its uncertainty and the best source that spoke of it (`UP_SOURCES`)."""
        if not self.started:
            prior = camera_prior(self._config.up)
            return UpDirection(prior.direction, prior.sigma, prior.source)
        return UpDirection(*self.smoother.up(), min(self._up_sources, key=UP_SOURCES.index))

    def _start(self, frame: Frame) -> np.ndarray:
        """The world: the dataset's with given poses, gravity-aligned where gravity is known, else the first camera."""
        config = self._config.up
        up = from_accelerometer(frame, config) or scanner_prior(frame, config) or camera_prior(config)
        T = np.eye(4)
        if self.map_frame is MapFrame.DATASET:
            T = self._tracking.T_odometry_camera
        elif up.source == "accelerometer":
            T[:3, :3] = upright_rotation(up.direction).T
            self.map_frame = MapFrame.GRAVITY_ALIGNED
        direction, sigma, source = T[:3, :3] @ up.direction, up.sigma, up.source
        if self._gravity is not None:
            direction, sigma, source = -self._gravity, self._config.up.gravity_sigma, "gravity file"
        self._up_sources = {source}
        self.intrinsics = frame.intrinsics
        self._smoother = Smoother(self._config.smoother, frame.intrinsics, self._config.up.upright_tolerance)
        self._smoother.add_first(T, GAUGE_SIGMAS, direction, sigma)
        if self._config.loops.enabled and self._config.odometry.source is not OdometrySource.POSES:
            self._loops = LoopCloser(self._config, self._smoother, self._sparse)
            if self._config.hybrid.enabled and frame.has_image and frame.scan is None:
                self._hybrid = HybridLinks(self._config, self._smoother)
            self._place.follow(self._smoother)
        return T

    def _measure_up(self, frame: Frame, keyframe: int, T_world_camera: np.ndarray) -> None:
        config, smoother = self._config.up, self.smoother
        # the first reading made the world's axes already
        measured: list[UpMeasurement | None] = [from_accelerometer(frame, config) if keyframe > 0 else None]
        if self._gravity is None and frame.scan is None and keyframe % config.every == 0:
            expected = T_world_camera[:3, :3].T @ smoother.R_world_upright[:, 2]
            measured.append(from_planes(frame, expected, config))
        for up in measured:
            if up is not None:
                smoother.add(Up(keyframe, up.direction, up.sigma))
                self._up_sources.add(up.source)
