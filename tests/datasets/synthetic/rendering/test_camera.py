"""Exposure, white balance and the time the shutter is open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thingmap.datasets.synthetic.rendering.camera import ColorCamera, develop, drifting_gains, exposure_poses

STAMPS = np.arange(600) / 30.0


def screw(stamps: np.ndarray) -> np.ndarray:
    """A camera that moves at (0.3, -0.2, 0.1) m/s and turns about (1, 2, 3) at 0.5 rad/s."""
    poses = np.tile(np.eye(4), (len(stamps), 1, 1))
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    poses[:, :3, :3] = Rotation.from_rotvec(0.5 * stamps[:, None] * axis).as_matrix()
    poses[:, :3, 3] = stamps[:, None] * (0.3, -0.2, 0.1)
    return poses


@pytest.mark.parametrize("index", [0, 7, 19])
@pytest.mark.parametrize("count", [2, 5])
def test_a_steady_motion_goes_on_while_the_shutter_is_open(index: int, count: int):
    stamps, shutter = STAMPS[:20], 0.025
    moments = stamps[index] + shutter * ((np.arange(count) + 0.5) / count - 0.5)
    found = exposure_poses(stamps, screw(stamps), index, shutter, count)
    np.testing.assert_allclose(found, screw(moments), atol=1e-12)


def test_before_a_frame_the_camera_comes_from_the_last_one_and_after_it_goes_to_the_next():
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 0, 3] = 0.0, 1.0, 5.0
    x = exposure_poses(np.array([0.0, 1.0, 2.0]), poses, 1, 0.4, 4)[:, 0, 3]
    np.testing.assert_allclose(x, [1 - 0.15, 1 - 0.05, 1 + 4 * 0.05, 1 + 4 * 0.15])


def test_the_middle_moment_is_the_frame_itself_and_a_single_frame_stands_still():
    poses = screw(STAMPS[:5])
    np.testing.assert_array_equal(exposure_poses(STAMPS[:5], poses, 2, 0.025, 5)[2], poses[2])
    np.testing.assert_array_equal(exposure_poses(STAMPS[3:4], poses[3:4], 0, 0.025, 3), np.stack([poses[3]] * 3))


def test_drift_has_the_stated_strength_and_moves_slowly():
    camera = ColorCamera(drift=0.05, white_drift=0.04)
    logs = np.log(np.stack([drifting_gains(camera, STAMPS, seed) for seed in range(60)]))
    exposure, red, blue = logs[..., 1], logs[..., 0] - logs[..., 1], logs[..., 2] - logs[..., 1]
    assert exposure.std() == pytest.approx(0.05, rel=0.15)
    assert red.std() == pytest.approx(0.04, rel=0.15) and blue.std() == pytest.approx(0.04, rel=0.15)
    assert abs(np.corrcoef(red.ravel(), blue.ravel())[0, 1]) < 0.3
    for field, sigma in ((exposure, 0.05), (red, 0.04), (blue, 0.04)):
        assert np.abs(np.diff(field, axis=1)).max() < 0.1 * sigma, "from one frame to the next"


def test_each_drift_has_its_switch():
    steady = ColorCamera(drift=0.0, white_drift=0.0)
    np.testing.assert_array_equal(drifting_gains(steady, STAMPS, 3), np.ones((600, 3)))
    grey = drifting_gains(replace(steady, drift=0.05), STAMPS, 3)
    assert grey.std() > 0.01
    np.testing.assert_array_equal(grey, np.repeat(grey[:, :1], 3, axis=1))
    white = drifting_gains(replace(steady, white_drift=0.05), STAMPS, 3)
    assert (white[:, 1] == 1.0).all() and white[:, [0, 2]].std(axis=0).min() > 0.005


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**31 - 1), length=st.integers(1, 599))
def test_a_longer_sequence_begins_with_the_same_gains(seed: int, length: int):
    camera = ColorCamera()
    longer, shorter = drifting_gains(camera, STAMPS, seed), drifting_gains(camera, STAMPS[:length], seed)
    np.testing.assert_allclose(longer[:length], shorter, rtol=1e-14)


def test_gains_multiply_light_by_channel():
    camera = ColorCamera(gain=1.0, blur=0.0, noise=0.0, chroma_noise=0.0)
    light = np.full((8, 8, 3), 0.25, np.float32)
    rng = np.random.default_rng(0)
    assert develop(light, 1.0, camera, rng)[0, 0].tolist() == [128, 128, 128]  # 255 * 0.5, rounded
    gains = np.array([1.44, 1.0, 0.64])
    assert develop(light, gains, camera, rng)[0, 0].tolist() == [153, 128, 102]
