"""Exp and Log of SE(3) for many poses, against GTSAM's for one."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest

from thingmap.mapper.trajectory.twist import exp, inverses, log


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.99e-4, 1.01e-4, 0.3, 2.0, 3.1415])
def test_exp_and_log_are_those_of_one_pose(angle: float):
    rng = np.random.default_rng(0)
    twists = rng.normal(size=(20, 6))
    twists[:, :3] *= angle / np.linalg.norm(twists[:, :3], axis=1, keepdims=True)
    expected = np.array([gtsam.Pose3.Expmap(x).matrix() for x in twists])
    np.testing.assert_allclose(exp(twists), expected, atol=1e-10)
    np.testing.assert_allclose(log(exp(twists)), twists, atol=1e-9)
    np.testing.assert_allclose(inverses(expected) @ expected - np.eye(4), 0.0, atol=1e-12)


def test_none_at_all():
    assert exp(np.empty((0, 6))).shape == (0, 4, 4) and log(np.empty((0, 4, 4))).shape == (0, 6)
