"""Boxes through the points of things: turned and sized as they are, none for what is round."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.mapper.labelling.box_config import BoxConfig
from thingmap.mapper.labelling.segment_box import fit_box, turned

VOXEL = 0.01
CONFIG = BoxConfig()


def box_points(
    size: tuple[float, float, float], yaw: float = 0.0, noise: float = 0.002, seed: int = 0, faces: str = "xXyYZ"
) -> np.ndarray:
    """A point in every square centimetre of a box's faces; small letters are the lower ends. It stands on a table."""
    rng, half, sides = np.random.default_rng(seed), np.array(size) / 2.0, []
    for face in faces:
        k = "xyz".index(face.lower())
        grids = [np.arange(-half[i], half[i], VOXEL) for i in range(3) if i != k]
        others = np.stack(np.meshgrid(*grids), axis=-1).reshape(-1, 2)
        sides.append(np.insert(others, k, -half[k] if face.islower() else half[k], axis=1))
    points = np.concatenate(sides)
    return (points + rng.normal(0.0, noise, points.shape)) @ turned(yaw).T + [0.3, -0.2, 0.5]


def cylinder_points(radius: float, height: float, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle, z = np.meshgrid(np.arange(0.0, 2 * np.pi, VOXEL / radius), np.arange(0.0, height, VOXEL))
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1).reshape(-1, 3)
    return points + rng.normal(0.0, 0.002, points.shape)


@pytest.mark.parametrize("yaw", [0.0, 0.2, 0.7, 1.2, 1.5])
@pytest.mark.parametrize("size", [(0.05, 0.19, 0.25), (0.08, 0.21, 0.32), (0.8, 0.45, 0.55)])
def test_a_turned_box_is_found_as_it_is(size, yaw):
    box = fit_box(box_points(size, yaw), VOXEL, CONFIG)
    assert box is not None and box.known.all()
    assert np.sort(box.size) == pytest.approx(np.sort(size), abs=0.008)
    assert box.center == pytest.approx([0.3, -0.2, 0.5], abs=0.006)
    assert abs((box.yaw - yaw + np.pi / 4) % (np.pi / 2) - np.pi / 4) < 0.04


@pytest.mark.parametrize("shape", [(0.03, 0.12), (0.04, 0.25), (0.15, 0.2)])
def test_what_is_round_has_no_turn(shape):
    assert fit_box(cylinder_points(*shape), VOXEL, CONFIG) is None


def test_walls_that_poses_have_smeared_are_where_they_are_densest():
    thick = box_points((0.8, 0.45, 0.55), 0.4, noise=0.004)
    worse = box_points((0.86, 0.53, 0.58), 0.4, noise=0.01, seed=1)[::6]
    box = fit_box(np.concatenate([thick, worse]), VOXEL, CONFIG)
    assert box is not None
    assert np.sort(box.size) == pytest.approx([0.45, 0.55, 0.8], abs=0.015)


def test_a_side_that_was_not_seen_is_not_known():
    front = fit_box(box_points((0.3, 0.2, 0.4), faces="x"), VOXEL, CONFIG)
    assert front is None or not front.known[0]
    two = fit_box(box_points((0.3, 0.2, 0.4), faces="xZ"), VOXEL, CONFIG)
    assert two is not None and two.known.all()  # the top tells width and depth, the front the height


def test_few_points_are_no_box():
    points = box_points((0.05, 0.19, 0.25))
    assert fit_box(points[: CONFIG.least_points - 1], VOXEL, CONFIG) is None
    assert fit_box(np.empty((0, 3)), VOXEL, CONFIG) is None


def test_a_few_stray_points_change_little():
    points = box_points((0.1, 0.2, 0.3), 0.5)
    stray = np.array([0.3, -0.2, 0.5]) + np.random.default_rng(3).uniform(-0.4, 0.4, (len(points) // 60, 3))
    clean, dirty = (fit_box(p, VOXEL, CONFIG) for p in (points, np.concatenate([points, stray])))
    assert clean is not None and dirty is not None
    assert dirty.size == pytest.approx(clean.size, abs=0.01)


@settings(max_examples=15)
@given(yaw=st.floats(0.0, 1.5), turn=st.floats(-3.0, 3.0), x=st.floats(-5.0, 5.0))
def test_a_box_moves_with_its_points(yaw, turn, x):
    points = box_points((0.08, 0.2, 0.3), yaw)
    moved = points @ turned(turn).T + [x, -x, 0.1]
    before, after = (fit_box(p, VOXEL, CONFIG) for p in (points, moved))
    assert before is not None and after is not None
    assert np.sort(after.size) == pytest.approx(np.sort(before.size), abs=0.006)
    assert after.center == pytest.approx(before.center @ turned(turn).T + [x, -x, 0.1], abs=0.005)
