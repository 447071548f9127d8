"""KISS-ICP on sweeps that were cast in a street of boxes."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))  # `lidar_street` is there

import lidar_street as world

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import BrokenFrame, Frame
from thingmap.datasets.lidar import NO_CAMERA, LidarScan
from thingmap.factors.plane_information import point_to_plane_covariance
from thingmap.mapper.config import LidarConfig, OdometryConfig, OdometrySource
from thingmap.mapper.trajectory.odometry.lidar_odometry import LidarOdometry, _raised
from thingmap.mapper.trajectory.odometry.odometry import OdometryStep, Tracking, TrackingOutcome
from thingmap.mapper.trajectory.odometry.sources import make_odometry
from thingmap.mapper.trajectory.rigid import inverse, rigid_motion, rotation_angle

BOXES = world.street()
FRAMES = 24
NO_IMAGE = np.empty((0, 0, 3), dtype=np.uint8), np.empty((0, 0), dtype=np.float32)


def as_frame(index: int, stamp: float, points: np.ndarray, times: np.ndarray | None = None) -> Frame:
    scan = LidarScan(points, world.T_CAMERA_LIDAR, times)
    return Frame(index, f"{index:06d}", stamp, *NO_IMAGE, NO_CAMERA, scan=scan)


def sweeps(moving: bool = False, boxes: tuple = BOXES, stride: int = 1) -> list[Frame]:
    frames = []
    for i, stamp in enumerate(world.drive(FRAMES)[0][::stride]):
        points, times = world.sweep(stamp, boxes, moving=moving)
        frames.append(as_frame(i, stamp, points, times if moving else None))
    return frames


@pytest.fixture(scope="module")
def still() -> list[Frame]:
    """Sweeps without motion in them, as KITTI's odometry benchmark has them."""
    return sweeps()


@pytest.fixture(scope="module")
def moving() -> list[Frame]:
    """Sweeps that a moving scanner takes, with the points' times."""
    return sweeps(moving=True)


def truth(stride: int = 1) -> np.ndarray:
    """(N, 4, 4) `T_first_camera`."""
    cameras = world.drive(FRAMES)[1][::stride] @ np.linalg.inv(world.T_CAMERA_LIDAR)
    return np.linalg.inv(cameras[0]) @ cameras


def track(frames: Iterable[Frame], **changes: object) -> list[Tracking]:
    odometry = LidarOdometry(OdometryConfig(lidar=LidarConfig(**changes)))  # type: ignore[arg-type]
    return [odometry.register(frame) for frame in frames]


def error(tracked: list[Tracking], stride: int = 1) -> float:
    """Root mean square distance of the cameras, aligned by SE(3), metres."""
    found, true = np.stack([t.T_odometry_camera[:3, 3] for t in tracked]), truth(stride)[: len(tracked), :3, 3]
    T = rigid_motion(found, true, np.ones(len(found)))
    return float(np.sqrt((((found @ T[:3, :3].T + T[:3, 3]) - true) ** 2).sum(axis=1).mean()))


def test_the_path_is_followed_in_camera_axes(still: list[Frame]) -> None:
    tracked = track(still)
    assert [t.outcome for t in tracked] == [TrackingOutcome.GOOD] * FRAMES
    np.testing.assert_array_equal(tracked[0].T_odometry_camera, np.eye(4))
    assert error(tracked) < 0.08  # on 14 m
    last, true = tracked[-1].T_odometry_camera, truth()[-1]
    assert rotation_angle(last[:3, :3].T @ true[:3, :3]) < 0.02
    np.testing.assert_allclose(last[:3, 3], true[:3, 3], atol=0.35)
    assert true[2, 3] > 12.0  # the camera looks along z, and that is where the vehicle went


def test_motion_within_the_sweep_is_taken_out(moving: list[Frame]) -> None:
    tracked = track(moving)
    assert [t.outcome for t in tracked] == [TrackingOutcome.GOOD] * FRAMES and error(tracked) < 0.1
    frame, T_camera_lidar = moving[10], world.T_CAMERA_LIDAR
    scan = frame.scan
    assert scan is not None and scan.times is not None
    motion = inverse(truth()[9]) @ truth()[10]
    when = np.stack([world.pose_at(frame.stamp + t) for t in scan.times])
    where = np.einsum("nij,nj->ni", when[:, :3, :3], scan.points) + when[:, :3, 3]
    off = {}
    for deskew in (True, False):
        odometry = LidarOdometry(OdometryConfig(lidar=LidarConfig(deskew=deskew)))
        points = odometry._points(frame, motion, 1.0 / world.HZ)
        T_world_camera = world.pose_at(frame.stamp) @ np.linalg.inv(T_camera_lidar)
        found = points @ T_world_camera[:3, :3].T + T_world_camera[:3, 3]
        off[deskew] = np.linalg.norm(found - where, axis=1)
    assert np.median(off[True]) < 0.03 and np.median(off[False]) > 0.1
    assert np.percentile(off[True], 99) < 0.2 * np.percentile(off[False], 99)


def test_every_second_sweep_has_the_same_motion_within(moving: list[Frame]) -> None:
    """Velocity is by stamps: with twice the time between frames a sweep is not bent twice as much."""
    frames = [replace(f, index=i) for i, f in enumerate(moving[::2])]
    assert error(track(frames), stride=2) < 0.15


def test_a_few_missing_sweeps_are_bridged_at_the_last_speed(still: list[Frame]) -> None:
    frames = [*still[:8], *still[12:18]]
    odometry = LidarOdometry(OdometryConfig())
    tracked = [odometry.register(frame) for frame in frames]
    assert [t.outcome for t in tracked] == [TrackingOutcome.GOOD] * len(frames)
    np.testing.assert_allclose(tracked[-1].T_odometry_camera[:3, 3], truth()[17][:3, 3], atol=0.35)


def test_the_same_sweeps_give_the_same_poses(still: list[Frame]) -> None:
    once, again = track(still[:8]), track(still[:8])
    for a, b in zip(once, again, strict=True):
        np.testing.assert_array_equal(a.T_odometry_camera, b.T_odometry_camera)


def test_steps_between_keyframes_and_how_sure_they_are(still: list[Frame]) -> None:
    odometry = LidarOdometry(OdometryConfig())
    steps: list[OdometryStep] = []
    for frame in still:
        odometry.register(frame)
        step = odometry.keyframe()
        assert (step is None) == (frame.index == 0)
        if step is not None:
            steps.append(step)
    true = truth()
    nees = []
    for i, step in enumerate(steps):
        difference = inverse(step.T_a_b) @ inverse(true[i]) @ true[i + 1]
        residual = np.r_[Rotation.from_matrix(difference[:3, :3]).as_rotvec(), difference[:3, 3]]
        nees.append(residual @ np.linalg.solve(step.covariance, residual) / 6.0)
    assert 0.2 < np.mean(nees[3:]) < 2.0


def test_the_map_of_a_lidar_has_planes_only_at_its_own_scale(still: list[Frame]) -> None:
    odometry = LidarOdometry(OdometryConfig())
    for frame in still[:4]:
        odometry.register(frame)
    assert still[3].scan is not None
    source, T, points = still[3].scan.camera_points(), odometry._T, odometry._icp.local_map.point_cloud()
    assert point_to_plane_covariance(source, T, points, radius_m=1.5).pairs > 150
    assert point_to_plane_covariance(source, T, points).pairs < 20


def test_a_bare_road_is_degenerate_and_keeps_its_speed() -> None:
    """Nothing but ground and two endless walls: along them only the motion before tells."""
    corridor = tuple(world.Box("", (30.0, side * 8.0), (400.0, 2.0, 6.0)) for side in (-1.0, 1.0))
    frames = sweeps(boxes=corridor)
    odometry = LidarOdometry(OdometryConfig())
    for frame, T in zip(frames[:10], truth(), strict=False):
        guess = inverse(truth()[frame.index - 1]) @ T if frame.index else None
        tracking = odometry.register(frame, guess)
        assert tracking.outcome is (TrackingOutcome.DEGENERATE if frame.index else TrackingOutcome.GOOD)
        odometry.keyframe()
    np.testing.assert_allclose(tracking.T_odometry_camera[:3, 3], truth()[9][:3, 3], atol=0.3)
    odometry.register(frames[10])
    step = odometry.keyframe()
    assert step is not None
    across, along = np.sqrt(np.diag(step.covariance))[[3, 5]]
    assert along > 2.0 * across


def test_a_sweep_of_elsewhere_is_lost_changes_nothing_and_is_survived(still: list[Frame]) -> None:
    odometry = LidarOdometry(OdometryConfig())
    for frame in still[:10]:
        odometry.register(frame)
        odometry.keyframe()
    before = odometry.register(still[10])
    rng = np.random.default_rng(0)
    rubbish = as_frame(11, still[11].stamp, rng.normal(0.0, 15.0, (8000, 3)).astype(np.float32))
    lost = odometry.register(rubbish)
    assert lost.outcome is TrackingOutcome.LOST
    moved = np.linalg.norm(lost.T_odometry_camera[:3, 3] - before.T_odometry_camera[:3, 3])
    assert moved == pytest.approx(world.SPEED / world.HZ, abs=0.15)  # as before
    again = odometry.register(still[12])
    assert again.outcome is TrackingOutcome.GOOD
    np.testing.assert_allclose(again.T_odometry_camera[:3, 3], truth()[12][:3, 3], atol=0.35)
    step = odometry.keyframe()
    assert step is not None and np.sqrt(step.covariance[5, 5]) > 1.0  # it was lost in between
    odometry.register(still[13])
    step = odometry.keyframe()
    assert step is not None and np.sqrt(step.covariance[5, 5]) < 0.1


def test_after_being_lost_for_long_a_new_map_begins(still: list[Frame]) -> None:
    odometry = LidarOdometry(OdometryConfig(lidar=LidarConfig(lost_frames=3)))
    for frame in still[:5]:
        odometry.register(frame)
    other = world.street(seed=5)
    turn = np.diag([1.0, -1.0, -1.0, 1.0])  # upside down, so that even the ground is none
    outcomes = []
    for i in range(5, 12):
        points, _ = world.sweep(still[i].stamp, other)
        turned = (points @ turn[:3, :3] + [0.0, 0.0, 20.0]).astype(np.float32)
        outcomes.append(odometry.register(as_frame(i, still[i].stamp, turned)).outcome)
    assert outcomes[:3] == [TrackingOutcome.LOST] * 3
    assert outcomes[-1] is not TrackingOutcome.LOST


def test_frames_that_cannot_be_registered_are_told(still: list[Frame]) -> None:
    odometry = LidarOdometry(OdometryConfig())
    odometry.register(still[0])
    with pytest.raises(BrokenFrame, match=r"no LiDAR scan, as the frames before had"):
        odometry.register(replace(still[1], scan=None))
    near = np.full((500, 3), 0.3, dtype=np.float32)
    with pytest.raises(BrokenFrame, match=r"000001: no valid depth \(0 returns in range\)"):
        odometry.register(as_frame(1, still[1].stamp, near))
    np.testing.assert_allclose(
        odometry.register(still[1]).T_odometry_camera, track(still[:2])[1].T_odometry_camera, atol=1e-12
    )


def test_the_elevation_of_points_is_raised_as_kiss_icp_does_for_kitti() -> None:
    pybind = pytest.importorskip("kiss_icp.pybind").kiss_icp_pybind
    points = np.random.default_rng(1).normal(0.0, 10.0, (200, 3))
    expected = np.asarray(pybind._correct_kitti_scan(pybind._Vector3dVector(points)))
    np.testing.assert_allclose(_raised(points, np.radians(0.205)), expected, atol=1e-9)
    assert _raised(points, 0.0) is points


def test_scans_get_their_own_odometry() -> None:
    assert isinstance(make_odometry(OdometryConfig(), has_scan=True), LidarOdometry)
    assert not isinstance(make_odometry(OdometryConfig()), LidarOdometry)
    assert not isinstance(make_odometry(OdometryConfig(source=OdometrySource.POSES), has_scan=True), LidarOdometry)
    with pytest.raises(UserError, match="small-gicp is for depth cameras; use kiss-icp for a LiDAR"):
        make_odometry(OdometryConfig(source=OdometrySource.SMALL_GICP), has_scan=True)
