"""How things lean in an image."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.frame import Intrinsics
from thingmap.detectors.shape_context.local_turn import local_turn

CAMERA = Intrinsics(80, 60, 100.0, 100.0, 40.0, 30.0)


def test_an_upright_camera_sees_things_upright(edge_map):
    edges = edge_map([(0, 0), (79, 10), (40, 59)])
    np.testing.assert_allclose(local_turn(edges, CAMERA, np.array([0.0, -1.0, 0.0])), 0.0, atol=1e-12)


@pytest.mark.parametrize("degrees", [-80.0, -10.0, 35.0])
def test_a_rolled_camera_turns_everything_alike(edge_map, degrees):
    roll = np.deg2rad(degrees)
    up = np.array([np.sin(roll), -np.cos(roll), 0.0])
    np.testing.assert_allclose(local_turn(edge_map([(3, 4), (70, 50)]), CAMERA, up), roll)


def test_a_line_upright_in_the_world_leans_as_told(edge_map):
    """Two points of it, one above the other, projected by the camera."""
    pitch = 0.5
    up = np.array([0.1, -np.cos(pitch), -np.sin(pitch)])
    up /= np.linalg.norm(up)
    foot = np.array([0.25, 0.1, 1.0])
    x, y = (CAMERA.fx * p[:2] / p[2] for p in (foot, foot + 1e-4 * up))
    leaning = np.arctan2((y - x)[0], -(y - x)[1])
    pixel = np.round(x + np.array([CAMERA.cx, CAMERA.cy])).astype(int)
    assert local_turn(edge_map([pixel]), CAMERA, up)[0] == pytest.approx(leaning, abs=0.02)
    assert abs(leaning) > 0.05
