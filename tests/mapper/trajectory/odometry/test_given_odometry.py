"""A trajectory file of another system as odometry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import BrokenFrame, FrameProblem
from thingmap.mapper.config import OdometryConfig, OdometrySource
from thingmap.mapper.trajectory.odometry.gicp_odometry import GicpOdometry
from thingmap.mapper.trajectory.odometry.given_odometry import PoseOdometry, TrajectoryOdometry, check_trajectory
from thingmap.mapper.trajectory.odometry.kiss_odometry import KissOdometry
from thingmap.mapper.trajectory.odometry.odometry import TrackingOutcome
from thingmap.mapper.trajectory.odometry.sources import make_odometry, with_source

WALL = [((0.0, 0.0, 1.0), 1.5)]


def pose(t: float) -> np.ndarray:
    """(4, 4), 0.3 m/s along x and 0.5 rad/s about y, from a place that is not the origin."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0.0, 0.5 * t, 0.0]).as_matrix()
    T[:3, 3] = [2.0 + 0.3 * t, -1.0, 0.5]
    return T


def write(path: Path, stamps) -> Path:
    rows = ["# stamp tx ty tz qx qy qz qw"]
    for t in stamps:
        T = pose(t)
        values = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()]
        rows.append(f"{t:.6f} " + " ".join(f"{v:.12f}" for v in values))
    path.write_text("\n".join(rows) + "\n")
    return path


def odometry_of(path: Path, **changes) -> TrajectoryOdometry:
    return TrajectoryOdometry(OdometryConfig(source=OdometrySource.FILE, path=str(path), **changes))


@pytest.fixture
def at(plane_frame):
    """`at(t)`: a frame taken at `t` seconds; what it shows and its true pose play no part."""
    return lambda t: replace(plane_frame(WALL), stamp=t, T_world_camera=None)


def test_poses_are_taken_by_stamp_between_two_rows(tmp_path, at):
    odometry = odometry_of(write(tmp_path / "other.txt", np.arange(0.0, 2.0, 0.08)))
    for t in (0.0, 0.08, 0.1, 1.3333):
        tracking = odometry.register(at(t))
        assert tracking.outcome is TrackingOutcome.GOOD
        np.testing.assert_allclose(tracking.T_odometry_camera, pose(t), atol=1e-6)


def test_steps_are_as_uncertain_as_the_configuration_says(tmp_path, at):
    path = write(tmp_path / "other.txt", np.arange(0.0, 2.0, 0.05))
    odometry = odometry_of(path, path_sigma=(0.02, 0.03), path_drift=(0.1, 0.2), covariance_floor=(9.0, 9.0))
    odometry.register(at(0.5))
    assert odometry.keyframe() is None
    odometry.register(at(0.7))  # no keyframe
    odometry.register(at(1.5))
    step = odometry.keyframe()
    assert step is not None
    np.testing.assert_allclose(pose(0.5) @ step.T_a_b, pose(1.5), atol=1e-6)
    turned, moved = np.hypot(0.02, 0.1 * 0.5), np.hypot(0.03, 0.2 * 0.3)
    np.testing.assert_allclose(step.covariance, np.diag(np.repeat([turned**2, moved**2], 3)), atol=1e-9)


def test_gaps_are_never_bridged(tmp_path, at):
    """Keyframes of another system: a frame between them has no pose, one within 0.02 s of a row has the row's."""
    odometry = odometry_of(write(tmp_path / "keyframes.txt", [0.0, 0.5, 1.0]))
    odometry.register(at(0.0))
    odometry.keyframe()
    for t, why in ((0.25, "0.50 s between its neighbours"), (-0.1, "before or after"), (1.1, "before or after")):
        with pytest.raises(BrokenFrame, match=why) as broken:
            odometry.register(at(t))
        assert broken.value.problem is FrameProblem.MISSING_POSE
    np.testing.assert_allclose(odometry.register(at(0.515)).T_odometry_camera, pose(0.5), atol=1e-9)
    step = odometry.keyframe()
    assert step is not None
    np.testing.assert_allclose(pose(0.0) @ step.T_a_b, pose(0.5), atol=1e-9)


def test_rows_that_say_lost_leave_a_gap(tmp_path, at):
    path = write(tmp_path / "other.txt", [0.0, 0.05, 0.15, 0.2])
    path.write_text(path.read_text() + "0.1 nan nan nan nan nan nan nan\n0.05 0 0 0 0 0 0 1\n")
    odometry = odometry_of(path)
    np.testing.assert_allclose(odometry.register(at(0.05)).T_odometry_camera, pose(0.05), atol=1e-9)  # the first counts
    np.testing.assert_allclose(odometry.register(at(0.1)).T_odometry_camera, pose(0.1), atol=1e-4)  # 0.1 s is bridged
    with pytest.raises(BrokenFrame):
        odometry.register(at(0.4))


def test_a_trajectory_of_another_clock_is_refused_with_both_ranges(tmp_path):
    path = write(tmp_path / "other.txt", [100.0, 101.0])
    with pytest.raises(InputError, match=r"0\.000000 to 1\.900000 s, found stamps 100\.000000 to 101\.000000"):
        check_trajectory(path, np.arange(0.0, 2.0, 0.1))
    check_trajectory(path, np.array([3.0, 100.01]))  # one frame is enough
    (tmp_path / "empty.txt").write_text("# nothing\n")
    with pytest.raises(InputError, match="found no pose"):
        check_trajectory(tmp_path / "empty.txt", np.arange(3.0))
    (tmp_path / "seven.txt").write_text("0 0 0 0 0 0 0\n")
    with pytest.raises(InputError, match="7 fields in line 1"):
        odometry_of(tmp_path / "seven.txt")


def test_the_source_is_a_word_or_a_file(tmp_path):
    path, default = write(tmp_path / "other.txt", [0.0, 0.1]), OdometryConfig(max_range=2.0)
    for word, kind in (("kiss-icp", KissOdometry), ("small-gicp", GicpOdometry), ("poses", PoseOdometry)):
        config = with_source(with_source(default, str(path)), word)  # over a file that a configuration named
        assert isinstance(make_odometry(config), kind) and config.max_range == 2.0
    config = with_source(default, str(path))
    assert config.source is OdometrySource.FILE and config.path == str(path)
    assert isinstance(make_odometry(config), TrajectoryOdometry)
    for wrong in ("kis-icp", str(tmp_path), str(tmp_path / "none.txt"), "file"):
        with pytest.raises(UserError, match="expected kiss-icp, small-gicp, poses or a file with rows `stamp tx"):
            with_source(default, wrong)
    with pytest.raises(UserError, match=r"did you mean kiss-icp\?"):
        with_source(default, "kis-icp")


def test_a_file_source_needs_a_path_and_no_other_takes_one():
    with pytest.raises(ValueError, match="`file` needs a path"):
        OdometryConfig(source=OdometrySource.FILE)
    with pytest.raises(ValueError, match="others have none"):
        OdometryConfig(path="x.txt")
