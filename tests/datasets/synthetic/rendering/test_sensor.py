"""The depth sensor's effects, one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.synthetic.rendering.sensor import IDEAL, DepthSensor, measure

CAMERA = Intrinsics(320, 240, 525.0, 525.0, 159.5, 119.5)
SHAPE = (240, 320)


def read(sensor: DepthSensor, depth: np.ndarray | float, cosine: float = 1.0, seed: int = 0) -> np.ndarray:
    true = np.broadcast_to(np.asarray(depth, np.float32), SHAPE).copy()
    return measure(true, np.full(SHAPE, cosine, np.float32), CAMERA, sensor, np.random.default_rng(seed))


def two_planes(near: float = 1.0, far: float = 2.0, column: int = 160) -> np.ndarray:
    """A near plane to the right of a column, a far one to the left."""
    depth = np.full(SHAPE, far, np.float32)
    depth[:, column:] = near
    return depth


def test_with_everything_off_it_reads_the_truth():
    depth = np.random.default_rng(1).uniform(0.2, 6.0, SHAPE).astype(np.float32)
    np.testing.assert_array_equal(read(IDEAL, depth), depth)


@pytest.mark.parametrize("z", [0.7, 1.5, 3.0, 4.4])
def test_axial_noise_grows_with_the_square_of_depth(z):
    error = read(replace(IDEAL, axial=True), z) - z
    assert error.std() == pytest.approx(1.425e-3 * z * z, rel=0.03)
    assert abs(error.mean()) < 0.05 * error.std()


def test_slanted_surfaces_are_noisier_by_the_stated_law():
    z, theta = 1.3, np.radians(65.0)
    error = read(replace(IDEAL, tilt=True), z, np.cos(theta)) - z
    expected = 1e-4 / np.sqrt(z) * (theta / (np.pi / 2 - theta)) ** 2
    assert error.std() == pytest.approx(expected, rel=0.03)
    assert read(replace(IDEAL, tilt=True), z, 1.0).std() < 1e-6


def test_readings_are_whole_steps_of_disparity():
    sensor = replace(IDEAL, quantised=True, axial=True)
    steps = sensor.focal * sensor.baseline / read(sensor, 2.5).astype(float) / sensor.disparity_step
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-3)
    assert len(np.unique(np.round(steps))) > 3
    depth = np.linspace(0.5, 4.0, SHAPE[0] * SHAPE[1]).reshape(SHAPE)
    quantised = read(replace(IDEAL, quantised=True), depth)
    half_step = depth**2 * sensor.disparity_step / (2 * sensor.focal * sensor.baseline)
    assert np.all(np.abs(quantised - depth) <= 1.1 * half_step)


def test_range_limits_drop_what_is_too_near_or_too_far():
    depth = np.where(np.arange(320) < 160, 0.3, 5.0) * np.ones(SHAPE)
    depth[:, 100:200] = 2.0
    reading = read(replace(IDEAL, range_limits=True), depth)
    assert not reading[:, :100].any() and not reading[:, 200:].any() and (reading[:, 100:200] == 2.0).all()


@pytest.mark.parametrize(("degrees", "dropped"), [(70.0, 0.0), (83.5, 0.5), (88.0, 1.0)])
def test_grazing_angles_drop_out(degrees, dropped):
    cosine = float(np.cos(np.radians(degrees)))
    assert (read(replace(IDEAL, grazing=True), 2.0, cosine) == 0).mean() == pytest.approx(dropped, abs=0.05)


def test_depth_edges_drop_out_and_nothing_else_does():
    reading = read(replace(IDEAL, edges=True), two_planes())
    assert (reading[:, 159:161] == 0).mean() == pytest.approx(0.6, abs=0.06)
    assert reading[:, :159].all() and reading[:, 161:].all()


def test_shadow_of_the_projector_has_the_width_of_the_disparity_jump():
    sensor = replace(IDEAL, shadow=True)
    reading = read(sensor, two_planes(1.0, 2.0))
    width = CAMERA.fx * sensor.baseline * (1 / 1.0 - 1 / 2.0)
    dark = np.flatnonzero(reading[0] == 0)
    assert dark[-1] == 159 and abs(len(dark) - width) <= 1.0, "left of the near plane"
    assert read(sensor, two_planes(2.0, 1.0)).all(), "none to the right of a near plane"
    assert read(sensor, 1.5).all(), "none on a plane"


def test_edges_waver_sideways_by_the_stated_deviation():
    reading = read(replace(IDEAL, lateral=True, lateral_sigma=2.0), two_planes())
    share_near = (reading == 1.0).mean(axis=0)
    assert share_near[150] < 0.001 and share_near[169] > 0.999
    assert share_near[158] == pytest.approx(0.23, abs=0.05)  # 1 - Phi(1.5 / 2)


def test_equal_seeds_read_equally_and_others_do_not():
    sensor = DepthSensor()
    a, b, c = (read(sensor, two_planes(), 0.5, seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(a, b)
    assert (a != c).mean() > 0.3
