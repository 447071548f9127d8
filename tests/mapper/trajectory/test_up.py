"""Up from supporting planes, the accelerometer and how cameras are held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.mapper.config import UpConfig
from thingmap.mapper.trajectory.up import camera_prior, from_accelerometer, from_planes

CONFIG = UpConfig()
HELD = np.array([0.0, -1.0, 0.0])  # up in an upright camera


def angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(a @ b, -1.0, 1.0))))


def support(pitch: float, roll: float = 0.0, below: float = 0.8) -> tuple[np.ndarray, tuple[np.ndarray, float]]:
    """Up in a camera that looks down by `pitch`, tilted sideways by `roll`, rad; and the plane `below` it, metres."""
    up = np.array([np.sin(roll), -np.cos(roll) * np.cos(pitch), -np.cos(roll) * np.sin(pitch)])
    return up, (up, -below)


def test_up_of_rendered_frames_is_found_within_two_degrees(tabletop):
    for frame in tabletop[::6]:
        truth = frame.T_world_camera[:3, :3].T @ [0.0, 0.0, 1.0]
        tilt = angle(truth, HELD)
        assert 10.0 < tilt < np.degrees(CONFIG.max_tilt)  # the camera looks down at the table
        measured = from_planes(frame, HELD, CONFIG)
        assert measured is not None and measured.source == "planes"
        assert angle(measured.direction, truth) < 2.0
        assert np.linalg.norm(measured.direction) == pytest.approx(1.0)
        assert measured.sigma == CONFIG.plane_sigma


def test_the_same_frame_gives_the_same_direction(tabletop):
    first, again = (from_planes(tabletop[3], HELD, CONFIG) for _ in range(2))
    assert first is not None and again is not None
    np.testing.assert_array_equal(first.direction, again.direction)


@settings(deadline=None, derandomize=True, max_examples=25)
@given(st.floats(0.3, 1.3), st.floats(-0.4, 0.4))
def test_up_is_the_normal_of_a_table_towards_the_expected_up(plane_frame, pitch, roll):
    up, plane = support(pitch, roll)
    frame = plane_frame([plane])
    measured = from_planes(frame, up, CONFIG)
    assert measured is not None
    assert angle(measured.direction, up) < 0.5
    # seen from below: the same plane with the other sign
    downwards = from_planes(frame, -up, CONFIG)
    assert downwards is not None
    assert angle(downwards.direction, -up) < 0.5


@pytest.mark.parametrize("lean", [0.0, 0.3, -0.3])
def test_walls_do_not_count(plane_frame, lean):
    """A wall straight ahead or leaning away; then a floor meets it, and only the floor counts."""
    wall = (np.array([0.0, np.sin(lean), np.cos(lean)]), 2.0)
    assert from_planes(plane_frame([wall]), HELD, CONFIG) is None
    up, floor = support(0.25, below=0.6)
    frame = plane_frame([wall, floor])
    measured = from_planes(frame, up, CONFIG)
    assert measured is not None
    assert angle(measured.direction, up) < 0.7


@pytest.mark.parametrize(("off", "counts"), [(CONFIG.max_tilt - 0.05, True), (CONFIG.max_tilt + 0.05, False)])
def test_a_plane_too_far_from_the_expected_up_is_no_support(plane_frame, off, counts):
    _, plane = support(0.7)
    expected = np.array([0.0, -np.cos(0.7 - off), -np.sin(0.7 - off)])
    assert (from_planes(plane_frame([plane]), expected, CONFIG) is not None) == counts


def test_a_small_plane_is_no_support(plane_frame):
    up, plane = support(0.8)
    frame = plane_frame([plane])
    depth = frame.depth.copy()
    depth[:, 100:] = np.random.default_rng(0).uniform(0.5, 2.0, (120, 60))  # clutter on the rest of the image
    cluttered = replace(frame, depth=depth)
    assert from_planes(cluttered, up, replace(CONFIG, min_plane_share=0.1)) is not None
    assert from_planes(cluttered, up, replace(CONFIG, min_plane_share=0.8)) is None


@pytest.mark.parametrize(("scale", "found"), [(1.0, True), (0.0, False), (np.nan, False), (0.1, False), (10.0, False)])
def test_only_depth_in_range_makes_a_plane(plane_frame, scale, found):
    """Scaled about the camera a plane stays a plane, with the same normal."""
    up, plane = support(0.7)
    frame = plane_frame([plane], noise=0.0)
    scaled = replace(frame, depth=(frame.depth * np.float32(scale)))
    assert (from_planes(scaled, up, CONFIG) is not None) == found


@settings(deadline=None, derandomize=True)
@given(st.tuples(*[st.floats(-12.0, 12.0)] * 3))
def test_the_accelerometer_counts_only_near_one_g(plane_frame, force):
    frame = replace(plane_frame([support(0.7)[1]]), specific_force=np.array(force))
    measured, g = from_accelerometer(frame, CONFIG), np.linalg.norm(force)
    if abs(g - 9.81) < 1.2:
        assert measured is not None and measured.source == "accelerometer"
        np.testing.assert_allclose(measured.direction * g, force, atol=1e-9)
        assert measured.sigma == CONFIG.accelerometer_sigma
    if abs(g - 9.81) > 2.0:
        assert measured is None


def test_no_accelerometer_no_measurement(plane_frame):
    frame = plane_frame([support(0.7)[1]])
    assert from_accelerometer(frame, CONFIG) is None
    assert from_accelerometer(replace(frame, specific_force=np.full(3, np.nan)), CONFIG) is None


def test_a_camera_is_held_upright_but_nobody_is_sure():
    prior = camera_prior(CONFIG)
    np.testing.assert_array_equal(prior.direction, HELD)
    assert (prior.sigma, prior.source) == (CONFIG.prior_sigma, "camera prior")
    assert prior.sigma > 2 * max(CONFIG.plane_sigma, CONFIG.accelerometer_sigma, CONFIG.gravity_sigma)
