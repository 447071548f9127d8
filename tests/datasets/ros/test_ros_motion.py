"""Poses and gravity that a bag tells."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thingmap.datasets.errors import InputError
from thingmap.datasets.open import open_sequence

OPTICAL = Rotation.from_matrix([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # camera axes in those of a robot
MOUNT = np.array([0.1, 0.0, 0.4])
TURN = Rotation.from_rotvec([0.0, 0.0, 0.3])


def _matrix(position: np.ndarray, rotation: Rotation) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation.as_matrix(), position
    return T


@pytest.fixture
def moving(record: Callable[..., Any], known: Any) -> Callable[[str], Any]:
    """A robot that drives along x at 1 m/s under a camera; its tree of frames, its odometry and its accelerometer."""

    def make(kind: str = "mcap") -> Any:
        made, m = record(kind), None
        m = made.messages
        static = m.transform(made.stamps[0], "base", known.frame, MOUNT, OPTICAL.as_quat())
        imu = m.transform(made.stamps[0], "base", "imu", np.zeros(3), TURN.as_quat())
        made.rows.append(("/tf_static", made.stamps[0], m.tf(static, imu)))
        for step in range(-2, 9):
            stamp = known.start + step * 20_000_000
            position = np.array([step * 0.02, 0.0, 0.0])
            identity = np.array([0.0, 0.0, 0.0, 1.0])
            made.rows += [
                ("/tf", stamp, m.tf(m.transform(stamp, "odom", "base", position, identity))),
                ("/odom", stamp, m.odometry(stamp, "odom", "base", position, identity)),
                ("/imu", stamp, m.imu(stamp, TURN.inv().apply([0.0, 0.0, 9.81]), "imu")),
            ]
        return made

    return make


@pytest.mark.parametrize("kind", ["bag", "mcap"])
@pytest.mark.parametrize("topic", ["/tf", "/odom"])
def test_poses_are_carried_to_the_camera(
    tmp_path: Path, moving: Callable[[str], Any], known: Any, kind: str, topic: str
) -> None:
    sequence = open_sequence(f"{moving(kind).write(tmp_path / f'a.{kind}')}?poses={topic}")
    assert sequence.poses is not None
    for i, pose in enumerate(sequence.poses):
        base = np.array([i * known.period / 1e9, 0.0, 0.0])
        np.testing.assert_allclose(pose, _matrix(base, Rotation.identity()) @ _matrix(MOUNT, OPTICAL), atol=1e-6)
    np.testing.assert_allclose(sequence[1].T_world_camera, sequence.poses[1])


def test_poses_are_taken_only_when_asked_for(tmp_path: Path, moving: Callable[..., Any]) -> None:
    assert open_sequence(moving().write(tmp_path / "a.mcap")).poses is None


def test_up_by_the_accelerometer(tmp_path: Path, moving: Callable[..., Any]) -> None:
    path = moving().write(tmp_path / "a.mcap")
    up = open_sequence(path)[1].up_at_rest
    np.testing.assert_allclose(up, [0.0, -1.0, 0.0], atol=1e-9)  # y of a camera points down
    assert open_sequence(f"{path}?imu=")[1].specific_force is None


def test_an_accelerometer_that_nothing_ties_to_the_camera(tmp_path: Path, moving: Callable[..., Any]) -> None:
    made = moving()
    made.rows = [row for row in made.rows if row[0] != "/tf_static"]
    path = made.write(tmp_path / "a.mcap")
    assert open_sequence(path)[0].specific_force is None
    with pytest.raises(InputError, match="no static transform from imu"):
        open_sequence(f"{path}?imu=/imu")


def test_a_gyroscope_alone_is_no_accelerometer(tmp_path: Path, moving: Callable[..., Any]) -> None:
    made = moving()
    for topic, _, message in made.rows:
        if topic == "/imu":
            message.linear_acceleration.x = message.linear_acceleration.y = message.linear_acceleration.z = 0.0
    path = made.write(tmp_path / "a.mcap")
    assert open_sequence(path)[0].specific_force is None
    with pytest.raises(InputError, match="median length of 0"):
        open_sequence(f"{path}?imu=/imu")


@pytest.mark.parametrize(("topic", "text"), [("/nowhere", "no such topic"), ("/imu", r"/imu \(sensor_msgs")])
def test_topics_without_poses(tmp_path: Path, moving: Callable[..., Any], topic: str, text: str) -> None:
    with pytest.raises(InputError, match=text) as caught:
        open_sequence(f"{moving().write(tmp_path / 'a.mcap')}?poses={topic}")
    assert "/odom (nav_msgs/msg/Odometry, 11)" in str(caught.value)


def test_odometry_that_nothing_ties_to_the_camera(tmp_path: Path, moving: Callable[..., Any]) -> None:
    made = moving()
    made.rows = [row for row in made.rows if row[0] != "/tf_static"]
    path = made.write(tmp_path / "a.mcap")
    with pytest.raises(InputError, match="static transforms from base"):
        open_sequence(f"{path}?poses=/odom")
    with pytest.raises(InputError, match="the frame camera_color_optical_frame in /tf"):
        open_sequence(f"{path}?poses=/tf")
