"""What brightness says about a pose, against derivatives of a painting that is known everywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.mapper.config import HybridConfig
from thingmap.mapper.trajectory.rgbd_view import RgbdView
from thingmap.mapper.trajectory.twist import exp
from thingmap.mapper.trajectory.visual.image_information import image_information

from .painted_wall import CAMERA, paint, wall_points, wall_view

CONFIG = HybridConfig(pixel_step=2)
A = exp(np.array([[0.1, -0.2, 0.3, 0.1, 0.0, 0.1]]))[0]


def brightness(T_world_camera: np.ndarray) -> np.ndarray:
    return paint(wall_points(T_world_camera)).reshape(CAMERA.height, CAMERA.width)


def test_the_hessian_is_that_of_the_painting():
    view = wall_view(A, noise=0.0)
    found = image_information(view, view, np.eye(4), replace(CONFIG, min_gradient=0.0, blur=0.5))
    # how bright each pixel is, as the camera moves: blur and finite differences take a few per cent off
    step = 1e-5
    twists = step * np.vstack([np.eye(6), -np.eye(6)])
    images = np.array([brightness(A @ T)[1:-1:2, 1:-1:2].ravel() for T in exp(twists)])
    J = (images[:6] - images[6:]).T / (2.0 * step)
    expected = J.T @ J * (found.pixels / len(J))
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(found.hessian / scale, expected / scale, atol=0.06)


def test_residuals_tell_how_far_edges_lie_apart():
    view = wall_view(A)
    at_rest = image_information(view, view, np.eye(4), CONFIG)
    slid = np.eye(4)
    slid[0, 3] = 3.0 * view.depth.mean() / CAMERA.fx  # three pixels
    moved = image_information(view, view, slid, CONFIG)
    assert at_rest.sigma < 1.0 and at_rest.shift < 0.5
    assert 1.0 < moved.shift < 4.0 and moved.sigma > 3.0 * at_rest.sigma


@pytest.mark.parametrize("T", [np.diag([-1.0, 1.0, -1.0, 1.0]), exp(np.array([[0, 0, 0, 9.0, 0, 0]]))[0]])
def test_what_is_not_seen_in_both_says_nothing(T: np.ndarray):
    view = wall_view(A)
    found = image_information(view, view, T, CONFIG)
    assert found.pixels == 0 and not found.hessian.any() and np.isnan(found.sigma)


def test_noise_alone_says_nothing():
    bare = wall_view(A, painted=False)
    assert image_information(bare, bare, np.eye(4), CONFIG).pixels < 50


def test_what_hides_something_is_left_out():
    view = wall_view(A)
    near = view.depth.copy()
    near[:, :160] = 0.5
    half = image_information(RgbdView(view.color, near, CAMERA), view, np.eye(4), CONFIG)
    whole = image_information(view, view, np.eye(4), CONFIG)
    assert 0.3 * whole.pixels < half.pixels < 0.7 * whole.pixels
