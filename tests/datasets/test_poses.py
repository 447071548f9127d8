from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from thingmap.datasets.errors import InputError
from thingmap.datasets.poses import (
    nearest_rotations,
    read_pose_rows,
    read_poses_at,
    read_tum_pose_rows,
    read_tum_poses,
)

numbers = st.floats(-10, 10)
rotations = (
    st.tuples(numbers, numbers, numbers, numbers)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: Rotation.from_quat(q))
)
trajectories = st.lists(st.tuples(rotations, st.tuples(numbers, numbers, numbers)), min_size=1, max_size=6)
in_files = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def matrices(trajectory: list) -> np.ndarray:
    poses = np.tile(np.eye(4), (len(trajectory), 1, 1))
    for matrix, (rotation, position) in zip(poses, trajectory, strict=True):
        matrix[:3, :3], matrix[:3, 3] = rotation.as_matrix(), position
    return poses


@in_files
@given(trajectories, st.sampled_from([1, -1]))
def test_tum_rows_come_back_as_the_poses_they_were_written_from(tmp_path: Path, trajectory: list, sign: int) -> None:
    path = tmp_path / "poses.txt"
    rows = [[i, *t, *(sign * r.as_quat())] for i, (r, t) in enumerate(trajectory)]  # scipy: x y z w
    path.write_text("# stamp tx ty tz qx qy qz qw\n" + "\n".join(" ".join(map(repr, map(float, r))) for r in rows))
    stamps, poses = read_tum_pose_rows(path)
    np.testing.assert_array_equal(stamps, range(len(trajectory)))
    np.testing.assert_allclose(poses, matrices(trajectory), atol=1e-12)
    np.testing.assert_allclose(read_tum_poses(path).matrices, matrices(trajectory), atol=1e-12)
    np.testing.assert_allclose(read_poses_at(path, stamps), matrices(trajectory), atol=1e-12)


@in_files
@given(trajectories)
def test_scalar_first_rows_come_back_as_the_poses_they_were_written_from(tmp_path: Path, trajectory: list) -> None:
    path = tmp_path / "02.pose"
    rows = [[*r.as_quat(scalar_first=True), *t] for r, t in trajectory]
    path.write_text("\n".join(" ".join(map(repr, map(float, r))) for r in rows))
    np.testing.assert_allclose(read_pose_rows(path), matrices(trajectory), atol=1e-12)


@given(rotations, st.tuples(numbers, numbers, numbers))
def test_rounded_matrices_become_rotations_and_stay_near(rotation: Rotation, position: tuple) -> None:
    matrix = matrices([(rotation, position)])
    (valid,), problems = nearest_rotations(np.round(matrix, 3))
    assert not problems
    np.testing.assert_allclose(valid[:3, :3].T @ valid[:3, :3], np.eye(3), atol=1e-14)
    assert np.linalg.det(valid[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(valid, matrix[0], atol=2e-3)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda m: m.__setitem__((0, 3), np.nan), "not finite"),
        (lambda m: m.__setitem__((slice(0, 3), slice(0, 3)), 1.1 * np.eye(3)), "off orthonormal by 0.21"),
        (lambda m: m.__setitem__((slice(0, 3), slice(0, 3)), np.zeros((3, 3))), "off orthonormal by 1"),
        (lambda m: m.__setitem__((0, 0), -1.0), "reflection"),
        (lambda m: m.__setitem__((3, 3), 2.0), "last row"),
    ],
)
def test_what_is_no_pose_is_told_and_its_neighbours_are_kept(change, word: str) -> None:
    poses = np.tile(np.eye(4), (3, 1, 1))
    change(poses[1])
    valid, problems = nearest_rotations(poses)
    assert list(problems) == [1]
    assert word in problems[1]
    assert np.isnan(valid[1]).all()
    np.testing.assert_array_equal(valid[[0, 2]], np.tile(np.eye(4), (2, 1, 1)))


def trajectory_file(path: Path, stamps: np.ndarray) -> tuple[Path, np.ndarray, Rotation]:
    """A smooth hand-held motion, and what it was made of."""
    positions = np.stack([stamps, stamps**2, np.zeros_like(stamps)], axis=1)
    turns = Rotation.from_rotvec(np.outer(stamps, [0.3, -0.8, 1.1]))
    rows = np.c_[stamps + 1.3e9, positions, turns.as_quat()]
    rows[1::2, 4:] *= -1  # the other of the two quaternions of the same rotation
    np.savetxt(path, rows, fmt="%.9f")
    return path, positions, turns


def test_between_rows_the_position_is_linear_and_the_rotation_spherical(tmp_path: Path) -> None:
    stamps = np.arange(0, 1, 0.05)
    path, positions, turns = trajectory_file(tmp_path / "gt.txt", stamps)
    asked = np.array([0.0, 0.012, 0.475, 0.9])
    poses = read_poses_at(path, asked + 1.3e9)
    assert poses is not None
    expected = np.stack([np.interp(asked, stamps, positions[:, k]) for k in range(3)], axis=1)
    np.testing.assert_allclose(poses[:, :3, 3], expected, atol=1e-5)
    np.testing.assert_allclose(poses[:, :3, :3], Slerp(stamps, turns)(asked).as_matrix(), atol=1e-5)


def test_a_gap_is_not_bridged_but_its_edges_reach_as_far_as_the_benchmark_allows(tmp_path: Path) -> None:
    stamps = np.array([0.0, 0.05, 0.5, 0.55])
    path, positions, _ = trajectory_file(tmp_path / "gt.txt", stamps)
    poses = read_poses_at(path, np.array([-0.03, -0.019, 0.06, 0.08, 0.3, 0.49, 0.56, 0.6]) + 1.3e9)
    assert poses is not None
    known = ~np.isnan(poses[:, 0, 0])
    np.testing.assert_array_equal(known, [False, True, True, False, False, True, True, False])
    np.testing.assert_allclose(poses[known, :3, 3], positions[[0, 1, 2, 3]], atol=1e-6)


def test_rows_that_say_lost_are_left_out_and_order_does_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "gt.txt"
    path.write_text("3 9 0 0 0 0 0 1\n1 7 0 0 0 0 0 1\n2 nan 0 0 0 0 0 1\n4 0 0 0 0 0 0 0\n1 8 0 0 0 0 0 1\n")
    trajectory = read_tum_poses(path)
    np.testing.assert_array_equal(trajectory.stamps, [1, 3])
    np.testing.assert_array_equal(trajectory.positions[:, 0], [7, 9])
    _, rows = read_tum_pose_rows(path)
    np.testing.assert_array_equal(np.isnan(rows[:, 0, 0]), [False, False, True, True, False])


def test_a_wrong_column_order_is_told_by_the_length_of_its_quaternions(tmp_path: Path) -> None:
    (tmp_path / "gt.txt").write_text("1 0 0 0 0 0 0 1\n2 0 0 0 1 1.5 -2.0 0.8\n")
    with pytest.raises(InputError, match=r"a quaternion of length 2.8\d? in pose 2"):
        read_tum_poses(tmp_path / "gt.txt")


def test_poses_of_another_recording_are_told_with_both_ranges(tmp_path: Path) -> None:
    (tmp_path / "gt.txt").write_text("100 0 0 0 0 0 0 1\n200 0 0 0 0 0 0 1\n")
    with pytest.raises(InputError, match=r"1\.000000 to 2\.000000, found stamps 100\.000000 to 200\.000000"):
        read_poses_at(tmp_path / "gt.txt", np.array([1.0, 2.0]))
    assert read_poses_at(tmp_path / "absent.txt", np.array([1.0])) is None
