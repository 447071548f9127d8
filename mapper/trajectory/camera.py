"""The camera's part of the graph: keyframe poses, odometry between them, and the up direction."""

from __future__ import annotations

import numpy as np

from ...datasets.frame import BrokenFrame, Frame, FrameProblem
from ..config import MapperConfig, OdometrySource
from ..estimation.ledger import Up, Visual
from ..estimation.smoother import Smoother
from ..estimation.view import View
from ..map.object_map import MapFrame, UpDirection
from ..map.upright import upright_rotation
from .features import FeatureExtractor
from .keyframes import FrameTrajectory, KeyframeSelector
from .odometry_sources import make_odometry
from .up import UpMeasurement, camera_prior, from_accelerometer, from_planes, scanner_prior
from .visual import VisualOdometry

UP_SOURCES = ("gravity file", "accelerometer", "planes", "LiDAR axis", "camera prior")  # the best first
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
        self._visual = VisualOdometry(config.visual, config.seed) if config.visual.enabled and not given else None
        self._features = FeatureExtractor(config.visual)
        self._selector = KeyframeSelector(config.keyframes)
        self._frames = FrameTrajectory()
        self._T_odometry_camera = np.eye(4)
        self._T_keyframe_camera = np.eye(4)
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
        self._T_odometry_camera = self._odometry.register(frame).T_odometry_camera
        if self._selector.is_keyframe(self._T_odometry_camera) or not self.started:
            return True
        last = self.smoother.keyframes - 1
        self._T_keyframe_camera = self._frames.append(frame.stamp, self._T_odometry_camera, last, False)
        return False

    def add_keyframe(self, frame: Frame) -> View:
        """Puts the tracked frame into the graph with its odometry and what it says about up."""
        step = self._odometry.keyframe()
        if step is None:
            T_world_camera, number = self._start(frame), 0
        else:
            T_world_camera = self.smoother.pose(self.smoother.keyframes - 1) @ step.T_a_b
            number = self.smoother.add_keyframe(step.T_a_b, step.covariance)
        self._T_keyframe_camera = self._frames.append(frame.stamp, self._T_odometry_camera, number, True)
        if self._visual is not None:
            for edge in self._visual.add_keyframe(number, self._features(frame)):
                self.smoother.add(Visual(edge.a, edge.b, edge.motion.T_a_b, edge.motion.covariance))
        self._measure_up(frame, number, T_world_camera)
        return View(frame, number, T_world_camera, self.smoother.R_world_upright)

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
            T = self._T_odometry_camera
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
