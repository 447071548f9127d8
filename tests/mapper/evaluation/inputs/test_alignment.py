"""Alignment of trajectories: exact where there is no noise, least squares where there is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thingmap.datasets.errors import UserError
from thingmap.mapper.evaluation.inputs.alignment import (
    align_poses,
    align_positions,
    align_similarity,
    anchor,
    trajectory_error,
)

ALIGNMENTS = (align_positions, align_poses)


def random_poses(seed: int, count: int = 12) -> np.ndarray:
    rng = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.random(count, rng=rng).as_matrix()
    poses[:, :3, 3] = rng.normal(size=(count, 3))
    return poses


def disturbed(poses: np.ndarray, seed: int) -> np.ndarray:
    rng, noisy = np.random.default_rng(seed), poses.copy()
    noisy[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(0.1 * rng.normal(size=(len(poses), 3))).as_matrix()
    noisy[:, :3, 3] += 0.1 * rng.normal(size=(len(poses), 3))
    return noisy


@given(st.integers(0, 10_000))
def test_both_recover_a_known_motion(seed: int) -> None:
    estimate, motion = random_poses(seed), random_poses(seed + 1, 1)[0]
    truth = motion @ estimate
    for align in ALIGNMENTS:
        alignment = align(estimate, truth)
        np.testing.assert_allclose(alignment.R, motion[:3, :3], atol=1e-9)
        np.testing.assert_allclose(alignment.t, motion[:3, 3], atol=1e-9)
        assert trajectory_error(estimate, truth, alignment) < 1e-9


@given(st.integers(0, 10_000))
def test_no_rigid_alignment_beats_positions(seed: int) -> None:
    estimate = random_poses(seed)
    truth = disturbed(estimate, seed)
    best = trajectory_error(estimate, truth, align_positions(estimate, truth))
    assert 0.0 < best <= trajectory_error(estimate, truth, align_poses(estimate, truth)) + 1e-12


def test_a_mirrored_path_is_not_mirrored_back() -> None:
    estimate = random_poses(3)
    truth = estimate.copy()
    truth[:, 0, 3] *= -1.0
    alignment = align_positions(estimate, truth)
    assert np.linalg.det(alignment.R) == pytest.approx(1.0)
    assert trajectory_error(estimate, truth, alignment) > 0.1


def test_positions_on_a_line_are_refused_but_poses_are_not() -> None:
    estimate = random_poses(4)
    estimate[:, :3, 3] = np.linspace(0.0, 1.0, len(estimate))[:, None] * np.array([1.0, 2.0, 3.0])
    motion = random_poses(5, 1)[0]
    with pytest.raises(UserError, match="line"):
        align_positions(estimate, motion @ estimate)
    np.testing.assert_allclose(align_poses(estimate, motion @ estimate).R, motion[:3, :3], atol=1e-9)


def test_error_is_the_root_of_the_mean_square() -> None:
    truth = random_poses(6, 4)
    estimate = truth.copy()
    estimate[0, 0, 3] += 0.2
    unmoved = align_poses(truth, truth)
    assert trajectory_error(estimate, truth, unmoved) == pytest.approx(0.1)


def test_the_angle_between_two_alignments() -> None:
    poses, turn = random_poses(7), np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec([0.0, 0.3, 0.0]).as_matrix()
    first, second = align_poses(poses, poses), align_poses(poses, turn @ poses)
    assert first.angle_to(second) == pytest.approx(0.3)


@pytest.mark.parametrize("align", ALIGNMENTS)
def test_poses_that_do_not_pair_are_refused(align) -> None:
    with pytest.raises(UserError, match="same N"):
        align(random_poses(1, 5), random_poses(1, 4))
    broken = random_poses(1)
    broken[2, 0, 0] = np.nan
    with pytest.raises(UserError, match="finite"):
        align(broken, random_poses(1))


@given(st.integers(0, 10_000), st.floats(0.2, 5.0))
def test_a_similarity_recovers_a_known_scale(seed: int, scale: float) -> None:
    estimate, motion = random_poses(seed), random_poses(seed + 1, 1)[0]
    scaled = estimate.copy()
    scaled[:, :3, 3] *= scale
    rigid, found = align_similarity(estimate, motion @ scaled)
    assert found == pytest.approx(scale)
    np.testing.assert_allclose(rigid.R, motion[:3, :3], atol=1e-9)
    np.testing.assert_allclose(rigid.t, motion[:3, 3], atol=1e-9)


@given(st.integers(0, 10_000))
def test_a_free_scale_never_makes_it_worse(seed: int) -> None:
    estimate = random_poses(seed)
    truth = disturbed(estimate, seed)
    rigid, scale = align_similarity(estimate, truth)
    scaled = estimate.copy()
    scaled[:, :3, 3] *= scale
    best = trajectory_error(estimate, truth, align_positions(estimate, truth))
    assert trajectory_error(scaled, truth, rigid) <= best + 1e-12


def test_an_anchor_makes_the_first_pose_the_same_whatever_follows() -> None:
    estimate = random_poses(8)
    truth = random_poses(9, 1)[0] @ disturbed(estimate, 8)
    np.testing.assert_allclose(anchor(estimate, truth).pose(estimate[0]), truth[0], atol=1e-12)
    assert trajectory_error(estimate, truth, anchor(estimate, truth)) > 0.05


def test_one_pose_is_enough_to_align_by_poses() -> None:
    estimate, truth = random_poses(10, 1), random_poses(11, 1)
    np.testing.assert_allclose(align_poses(estimate, truth).pose(estimate[0]), truth[0], atol=1e-12)
    with pytest.raises(UserError, match="N >= 3"):
        align_positions(estimate, truth)
