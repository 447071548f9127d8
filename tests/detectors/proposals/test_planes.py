"""Large planes and the way up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.detectors.proposals.config import PlaneConfig
from thingmap.detectors.proposals.planes import _likely_up, find_planes
from thingmap.detectors.proposals.point_grid import point_grid

from .conftest import CAMERA, table_depth, up_of

TOWER = (0.0, 0.7, 0.12, 0.12, 0.25)


def planes_of(depth: np.ndarray, up: np.ndarray | None = None, config: PlaneConfig | None = None):
    return find_planes(point_grid(depth, CAMERA, 2, 0.2, 4.0), CAMERA, config or PlaneConfig(), up)


def angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.arccos(np.clip(a @ b, -1, 1)))


@pytest.mark.parametrize("pitch", [0.35, 0.6, 0.95])
def test_table_and_wall(pitch: float):
    found = planes_of(table_depth([TOWER], pitch=pitch))
    assert angle(found.up, up_of(pitch)) < 0.02
    table = np.flatnonzero(found.is_support)
    assert len(table) == 1
    assert found.offsets[table[0]] == pytest.approx(-0.5, abs=0.005)
    assert angle(found.normals[table[0]], up_of(pitch)) < 0.02
    walls = [p for p in range(len(found)) if not found.is_support[p]]
    if pitch < 0.9:  # further down it is out of view
        assert any(found.offsets[p] == pytest.approx(-1.2, abs=0.01) for p in walls)


def test_area_and_depth_of_a_plane_seen_from_the_front():
    found = planes_of(np.full((240, 320), 1.0, dtype=np.float32))
    assert len(found) == 1 and not found.is_support[0]
    assert found.areas[0] == pytest.approx(240 * 320 / 260.0**2, rel=0.02)
    assert found.depths[0] == pytest.approx(1.0)


def test_two_heights_are_two_supports():
    found = planes_of(table_depth([(0.1, 0.75, 0.6, 0.3, 0.12)], wall=None))
    heights = np.sort(-found.offsets[found.is_support])
    assert heights == pytest.approx([0.38, 0.5], abs=0.01)


def test_the_top_of_a_thing_is_no_support_but_a_small_shelf_alone_is():
    config = PlaneConfig()
    side = np.sqrt(0.5 * (config.min_lowest + config.min_horizontal))
    top = planes_of(table_depth([(0.0, 0.6, side, side, 0.12)]))
    assert not np.isclose(top.offsets[top.is_support], -0.38, atol=0.02).any()
    alone = table_depth([(0.0, 0.6, side, side, 0.12)], wall=None)
    on_top = np.isclose(_height_above_table(alone), 0.12, atol=1e-3)
    alone[~on_top] = 0.0
    found = planes_of(alone, up_of(0.6))
    assert found.offsets[found.is_support] == pytest.approx([-0.38], abs=0.01)


def _height_above_table(depth: np.ndarray) -> np.ndarray:
    points = point_grid(depth, CAMERA, 1, 0.2, 4.0).points
    return points @ up_of(0.6) + 0.5


def test_a_given_up_decides_what_is_a_support():
    depth = table_depth([TOWER])
    sideways = planes_of(depth, np.array([2.0, 0.0, 0.0]))
    assert not sideways.is_support.any()
    assert np.array_equal(sideways.up, [1.0, 0.0, 0.0])


def test_the_foot_of_a_thing_is_not_the_table():
    depth = table_depth([TOWER])
    found = planes_of(depth)
    grid = point_grid(depth, CAMERA, 2, 0.2, 4.0)
    height = grid.points @ up_of(0.6) + 0.5
    side = (np.abs(grid.points[..., 0]) < 0.05) & (height > 0.012) & (height < 0.24) & (grid.depth < 1.0)
    assert side.sum() > 500
    assert (found.owner[side] < 0).mean() > 0.97
    table = np.abs(height) < 1e-3
    assert (found.owner[table] >= 0).mean() > 0.97


def test_no_depth_no_planes():
    found = planes_of(np.zeros((240, 320), dtype=np.float32))
    assert len(found) == 0 and (found.owner == -1).all()
    assert np.array_equal(found.up, [0.0, -1.0, 0.0])


def test_noise_does_not_part_a_table():
    rng = np.random.default_rng(0)
    depth = table_depth([TOWER], wall=None)
    noisy = depth + rng.normal(size=depth.shape).astype(np.float32) * 1.4e-3 * depth**2
    found = planes_of(noisy)
    assert found.is_support.sum() == 1 and len(found) == 1


def test_accelerometer(make_table):
    up = up_of(0.6)
    assert make_table([]).up_at_rest is None
    np.testing.assert_allclose(make_table([], specific_force=9.8 * up).up_at_rest, up)
    assert make_table([], specific_force=15.0 * up).up_at_rest is None


def test_what_is_large_is_configured():
    depth = table_depth([TOWER])
    none = planes_of(depth, None, replace(PlaneConfig(), min_horizontal=50.0, min_lowest=50.0, min_other=50.0))
    assert len(none) == 0


def test_walls_say_which_of_two_slopes_is_level():
    tilt = 0.5
    normals = np.array([[0.0, -1.0, 0.0], [0.0, -np.cos(tilt), -np.sin(tilt)], [0.0, 0.0, -1.0]])
    areas = np.array([0.3, 0.5, 1.0])
    np.testing.assert_allclose(_likely_up(normals, areas, PlaneConfig()), normals[0])
    np.testing.assert_allclose(_likely_up(normals[:2], areas[:2], PlaneConfig()), normals[1])


def test_what_does_not_face_as_the_plane_is_not_on_it():
    depth = table_depth([(0.05 * k, 0.6, 0.02, 0.02, 0.25) for k in range(-3, 4)])  # too thin for planes of their own
    grid = point_grid(depth, CAMERA, 1, 0.2, 4.0)
    found = find_planes(grid, CAMERA, replace(PlaneConfig(), tolerance=0.03), up_of(0.6))
    height = grid.points @ up_of(0.6) + 0.5
    side = (height > 0.012) & (height < 0.028) & (grid.depth < 1.0)
    assert side.sum() > 100
    assert (found.owner[side] < 0).mean() > 0.8
