"""A camera in a box-shaped room: depth and features of six walls, and what a loop closer makes of them."""

from __future__ import annotations

import zlib
from dataclasses import fields, replace

import gtsam
import numpy as np

from thingmap.datasets.frame import Intrinsics
from thingmap.mapper.config import LoopConfig, MapperConfig, SmootherConfig, SparseConfig
from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.estimation.smoother import Smoother
from thingmap.mapper.trajectory.loops.loop_closer import LoopCloser
from thingmap.mapper.trajectory.sparse_frames import SparseFrames
from thingmap.mapper.trajectory.visual.features import Features

CAMERA = Intrinsics(96, 72, 78.0, 78.0, 47.5, 35.5)
LOW, HIGH = np.array([-1.2, -0.8, -1.6]), np.array([1.0, 0.7, 1.8])  # m, corners of the room
CORNERS = 1200  # features on the walls
SURE = np.diag(np.repeat([0.002**2, 0.003**2], 3))  # of an odometry step, rad^2 and m^2
VAGUE = np.diag(np.repeat([0.02**2, 0.02**2], 3))
SHORT = LoopConfig(
    process=False, lag=3, ages=(4, 12), skip=2, place_spacing=(0.03, 0.03), min_age=12, check_every=4, check_lag=2
)  # as short as these walks are


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0, turn: float = 0.0) -> np.ndarray:
    """`T_world_camera` turned about the vertical by `turn`, rad."""
    return gtsam.Pose3(gtsam.Rot3.Ry(turn), np.array([x, y, z])).matrix()


def tangent(T: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(6,) right tangent [rad, m] from an estimate to the truth."""
    return gtsam.Pose3.Logmap(gtsam.Pose3(T).between(gtsam.Pose3(truth)))


def retracted(T: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """(4, 4) `T Exp(twist)`."""
    return (gtsam.Pose3(T) * gtsam.Pose3.Expmap(twist)).matrix()


def depth_points(T_world_camera: np.ndarray, noise: float = 0.0015) -> np.ndarray:
    """(N, 3) of the walls, camera frame; `noise` times z^2 is the deviation of a reading, metres."""
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = CAMERA.back_project(np.stack([u.ravel(), v.ravel()], axis=1), np.ones(u.size))
    R, t = T_world_camera[:3, :3], T_world_camera[:3, 3]
    along = rays @ R.T
    with np.errstate(divide="ignore"):
        z = np.where(along > 0.0, (HIGH - t) / along, (LOW - t) / along).min(axis=1)
    z += noise * z**2 * _noise(T_world_camera).normal(size=len(z))
    return rays * z[:, None]


def features(T_world_camera: np.ndarray, noise: float = 0.0015) -> Features:
    """Of the walls, each with the descriptor that it always has."""
    rng = np.random.default_rng(0)
    corners = rng.uniform(LOW, HIGH, (CORNERS, 3))
    wall, side = rng.integers(0, 3, CORNERS), rng.integers(0, 2, CORNERS)
    corners[np.arange(CORNERS), wall] = np.where(side == 0, LOW[wall], HIGH[wall])
    descriptors = rng.integers(0, 256, (CORNERS, 32), dtype=np.uint8)
    points = (corners - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
    points += noise * points[:, 2:] ** 2 * _noise(T_world_camera).normal(size=points.shape)
    pixels = CAMERA.project(np.where(points[:, 2:] > 0.3, points, 1.0))
    size = np.array([CAMERA.width, CAMERA.height]) - 1.0
    seen = (points[:, 2] > 0.3) & (pixels >= 0.0).all(axis=1) & (pixels <= size).all(axis=1)
    return Features(descriptors[seen], points[seen])


def _noise(T: np.ndarray) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(np.round(T, 6).tobytes()))


class Walk:
    """Keyframes put into a graph and a loop closer as the camera's part of the graph does."""

    def __init__(self, loops: LoopConfig = SHORT, start: np.ndarray | None = None) -> None:
        self.smoother = Smoother(SmootherConfig(), CAMERA)
        self.closer = LoopCloser(replace(MapperConfig(), loops=loops), self.smoother, SparseFrames(SparseConfig()))
        self.truth: list[np.ndarray] = [pose() if start is None else start]
        self.closed: list[int] = []  # keyframes with which a loop was closed
        self.smoother.add_first(self.truth[0], np.repeat([1e-3, 1e-3], 3), np.array([0.0, -1.0, 0.0]), 0.6)
        self._match(adrift=False, shift=np.zeros(3))

    @property
    def last(self) -> int:
        """Number of the latest keyframe."""
        return self.smoother.keyframes - 1

    def step(
        self,
        T_world_camera: np.ndarray,
        error: np.ndarray | None = None,
        covariance: np.ndarray = SURE,
        adrift: bool = False,
        shift: np.ndarray | None = None,
    ) -> None:
        """The next keyframe, truly there; odometry errs by a (6,) twist, and its depth lies by a (3,) shift, m."""
        motion = np.linalg.inv(self.truth[-1]) @ T_world_camera
        if error is not None:
            motion = retracted(motion, error)
        if self.closer.collect(self.smoother.keyframes):
            self.closed.append(self.smoother.keyframes)
        self.smoother.add_keyframe(motion, covariance)
        self.truth.append(T_world_camera)
        self._match(adrift, np.zeros(3) if shift is None else shift)

    def error(self, keyframe: int) -> np.ndarray:
        """(6,) of a keyframe as estimated now."""
        return tangent(self.smoother.pose(keyframe), self.truth[keyframe])

    def records(self, kind: type) -> list:
        """Of the ledger."""
        return [record for record in self.smoother.ledger if isinstance(record, kind)]

    def _match(self, adrift: bool, shift: np.ndarray) -> None:
        self.smoother.update()
        T = self.truth[-1]
        self.closer.add_keyframe(self.last, features(T), depth_points(T) + shift, adrift)


def rocking(keyframes: int) -> list[np.ndarray]:
    """There and back, again and again, a swing in 20 keyframes; every keyframe's place is a little new."""
    t = np.arange(1, keyframes)
    swing = np.sin(2.0 * np.pi * t / 20.0)
    return [pose(0.25 * s, 0.002 * n, 0.1 * s, 0.2 * s) for n, s in zip(t, swing, strict=True)]


def lap(keyframes: int = 36) -> list[np.ndarray]:
    """Once around itself, 10 degrees a keyframe; what is beyond 36 has been seen before, from nearly there."""
    return [pose(0.05 * np.sin(0.3 * n), 0.0, 0.02 * (n // 36), np.radians(10.0) * n) for n in range(1, keyframes)]


def assert_same(one: Ledger, other: Ledger) -> None:
    """The same records, to the last bit."""
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert type(a) is type(b)
        for f in fields(a):
            np.testing.assert_array_equal(getattr(a, f.name), getattr(b, f.name))
