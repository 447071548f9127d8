"""The cloud of a page: thinned evenly, packed so that the page gets it back, and facing the camera."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from thingmap.mapper.view.page.cloud import PageCloud, morton_order, pack, page_cloud, thin_out
from thingmap.mapper.view.page.facing import STEPS, UNKNOWN, octahedral_codes


def a_wall(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Points of a square of 2 m, nine of ten in one of its quarters."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, 2.0, (count, 3))
    points[: 9 * count // 10, :2] *= 0.5
    points[:, 2] = 0.0
    return points, rng.integers(0, 256, (count, 3)).astype(np.uint8)


def unpack(content: bytes, cloud: PageCloud) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What data.js does."""
    planes = np.frombuffer(zlib.decompress(content), dtype=np.uint8).reshape(10, -1).astype(np.int64)
    steps = np.stack([np.cumsum(planes[2 * k] + 256 * planes[2 * k + 1]) % 65536 for k in range(3)], axis=1)
    low, high = cloud.bounds
    colors = np.stack([np.cumsum(planes[6 + k]) % 256 for k in range(3)], axis=1)
    return low + steps / 65535.0 * (high - low), colors.astype(np.uint8), planes[9].astype(np.uint8)


@given(st.integers(1, 3000), st.integers(8, 2000), st.integers(0, 3))
def test_never_more_points_than_asked_for_and_not_many_fewer(count: int, asked: int, seed: int) -> None:
    points, colors = a_wall(count, seed)
    thin, thin_colors, voxel = thin_out(points, colors, asked)
    assert len(thin) == len(thin_colors) <= asked
    assert (voxel == 0.0) == (count <= asked)
    assert len(thin) >= min(count, 0.4 * asked)


def test_thinning_makes_an_uneven_cloud_even() -> None:
    points, colors = a_wall(40_000)
    thin, _, voxel = thin_out(points, colors, 1500)
    assert len(thin) > 1200
    dense = np.mean(np.all(thin[:, :2] < 1.0, axis=1))
    assert 0.2 < dense < 0.35  # a quarter of the square held nine of ten points
    assert np.median(cKDTree(thin).query(thin, k=2)[0][:, 1]) == pytest.approx(voxel, rel=0.4)


def test_no_points_at_all_and_points_that_are_none() -> None:
    nothing = page_cloud(np.empty((0, 3)), np.empty((0, 3)), np.zeros((1, 3)), 100)
    assert len(nothing.points) == 0 and zlib.decompress(pack(nothing)) == b""
    points, colors = a_wall(100)
    points[3] = np.nan
    assert page_cloud(points, colors, np.zeros((1, 3)), 1000).of == 99
    assert len(page_cloud(points, colors, np.zeros((1, 3)), 0).points) == 0


def test_the_page_gets_points_and_colours_back() -> None:
    points, colors = a_wall(5000)
    cloud = page_cloud(points, colors, np.array([[1.0, 1.0, 3.0]]), 5000)
    places, paint, facing = unpack(pack(cloud), cloud)
    assert np.abs(places - cloud.points).max() < 2.0 / 65535.0
    np.testing.assert_array_equal(paint, cloud.colors)
    np.testing.assert_array_equal(facing, cloud.facing)


def test_neighbours_of_the_list_are_near_and_that_makes_the_page_smaller() -> None:
    points, colors = a_wall(20_000)
    colors[:] = np.round(100.0 + 50.0 * points)
    ordered = points[morton_order(points)]
    assert (
        np.linalg.norm(np.diff(ordered, axis=0), axis=1).mean()
        < 0.05 * np.linalg.norm(np.diff(points, axis=0), axis=1).mean()
    )
    cloud = page_cloud(points, colors, np.zeros((1, 3)), len(points))
    assert len(pack(cloud)) < 0.75 * 10 * len(points)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_wall_faces_the_camera_that_saw_it(side: float) -> None:
    points, colors = a_wall(2000)
    cloud = page_cloud(points, colors, np.array([[1.0, 1.0, side]]), 2000)
    np.testing.assert_allclose(directions(cloud.facing), np.tile([0.0, 0.0, side], (2000, 1)), atol=1e-6)


def test_without_a_camera_no_side_is_known() -> None:
    points, colors = a_wall(100)
    assert set(page_cloud(points, colors, np.empty((0, 3)), 100).facing) == {UNKNOWN}


def test_a_code_is_near_the_direction_it_stands_for() -> None:
    normals = np.random.default_rng(1).normal(size=(2000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cosine = np.sum(directions(octahedral_codes(normals)) * normals, axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).max() < 16.0


def directions(codes: np.ndarray) -> np.ndarray:
    """What points.vert does."""
    xy = np.stack([codes // 16, codes % 16], axis=1) / (STEPS - 1) * 2.0 - 1.0
    z = 1.0 - np.abs(xy).sum(axis=1)
    xy = np.where(z[:, None] < 0.0, (1.0 - np.abs(xy[:, ::-1])) * np.where(xy >= 0.0, 1.0, -1.0), xy)
    normals = np.column_stack([xy, z])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)
