"""The hand-held orbit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.datasets.synthetic.motion.orbit import OrbitConfig, hand_held

STAMPS = np.arange(200) / 30.0


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**31 - 1))
def test_steps_stay_within_what_odometry_follows(seed):
    poses = hand_held(STAMPS, seed)
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    turns = np.einsum("nij,nij->n", poses[1:, :3, :3], poses[:-1, :3, :3])
    degrees = np.degrees(np.arccos(np.clip((turns - 1.0) / 2.0, -1.0, 1.0)))
    assert steps.max() < 0.02 and np.median(steps) < 0.015
    assert degrees.max() < 1.5


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**31 - 1))
def test_poses_are_rigid_and_look_at_the_table_from_outside(seed):
    poses = hand_held(STAMPS, seed)
    R = poses[:, :3, :3]
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (200, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), 1.0)
    to_table = np.array(OrbitConfig().gaze) - poses[:, :3, 3]
    ahead = np.einsum("ni,ni->n", to_table, R[:, :, 2]) / np.linalg.norm(to_table, axis=1)
    assert ahead.min() > np.cos(np.radians(15.0))
    assert R[:, 2, 1].max() < -0.8, "image rows run down"
    distance = np.linalg.norm(poses[:, :2, 3], axis=1)
    assert distance.min() > 0.95 and distance.max() < 1.45


def test_a_longer_path_begins_like_a_shorter_one():
    np.testing.assert_array_equal(hand_held(STAMPS, 3)[:50], hand_held(STAMPS[:50], 3))


def test_without_shake_it_is_an_arc():
    still = OrbitConfig(shake_position=0.0, shake_gaze=0.0, shake_roll=0.0)
    poses = hand_held(STAMPS, 0, still)
    np.testing.assert_allclose(np.linalg.norm(poses[:, :2, 3], axis=1), still.radius)
    np.testing.assert_allclose(poses[:, 2, 3], still.height)
    assert np.linalg.norm(poses[0, :3, 3] - poses[-1, :3, 3]) == pytest.approx(2.0, abs=0.4)
