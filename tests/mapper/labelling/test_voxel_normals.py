"""Normals of voxels from those around them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from labelling_problems import SEEDS

from thingmap.mapper.labelling.voxel_normals import surface_normals

UP, OUT = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


def by_definition(cells: np.ndarray, normals: np.ndarray, radius: float, agreement: float) -> np.ndarray:
    """All pairs, as a table."""
    known = np.nan_to_num(normals)
    is_near = ((cells[:, None] - cells[None]) ** 2).sum(axis=2) <= radius**2
    takes = is_near & ((known @ known.T > agreement) | ~(np.abs(known).sum(axis=1) > 0.0)[:, None])
    sums = takes.astype(float) @ known
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(length > 1e-6, sums / length, np.nan)


def some_voxels(rng: np.random.Generator, count: int, extent: int) -> np.ndarray:
    """Different cells in a cube, sorted."""
    chosen = np.sort(rng.choice(extent**3, size=min(count, extent**3), replace=False))
    return np.stack(np.unravel_index(chosen, (extent,) * 3), axis=1) - extent // 2


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, radius=st.floats(0.0, 6.0), agreement=st.floats(-1.0, 0.95))
def test_it_is_the_mean_over_the_ball_of_those_that_agree(seed: int, radius: float, agreement: float) -> None:
    rng = np.random.default_rng(seed)
    cells = some_voxels(rng, 80, 9)
    normals = rng.normal(size=(len(cells), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[rng.random(len(cells)) < 0.2] = np.nan
    normals = normals.astype(np.float32)
    found = surface_normals(cells, normals, radius, agreement)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, by_definition(cells, normals, radius, agreement), atol=1e-4)


def test_the_order_of_voxels_does_not_matter() -> None:
    rng = np.random.default_rng(0)
    cells, order = some_voxels(rng, 200, 12), rng.permutation(200)
    normals = rng.normal(size=(200, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = surface_normals(cells, normals, 3.0, 0.5)
    np.testing.assert_allclose(surface_normals(cells[order], normals[order], 3.0, 0.5), found[order], atol=1e-6)


def test_noise_goes_and_a_crease_stays() -> None:
    """A table along x from 0 on, and a wall at x = 0 that looks along x."""
    table = np.stack(np.meshgrid(np.arange(1, 20), np.arange(30), [0], indexing="ij"), axis=-1).reshape(-1, 3)
    wall = np.stack(np.meshgrid([0], np.arange(30), np.arange(20), indexing="ij"), axis=-1).reshape(-1, 3)
    cells, true = np.concatenate([table, wall]), np.repeat([UP, OUT], [len(table), len(wall)], axis=0)
    noisy = true + np.random.default_rng(1).normal(scale=0.15, size=true.shape)
    noisy = (noisy / np.linalg.norm(noisy, axis=1, keepdims=True)).astype(np.float32)
    before = (noisy * true).sum(axis=1)
    after = (surface_normals(cells, noisy, np.sqrt(27.0), 0.9) * true).sum(axis=1)
    assert np.quantile(before, 0.1) < np.cos(np.radians(15.0)) and np.quantile(after, 0.1) > np.cos(np.radians(8.0))
    near_crease = (cells[:, 0] <= 1) & (cells[:, 2] <= 1)
    of_all = (surface_normals(cells, noisy, np.sqrt(27.0), -1.0) * true).sum(axis=1)
    assert after[near_crease].mean() > np.cos(np.radians(10.0)) > 0.93 > of_all[near_crease].mean()


def test_a_voxel_without_normal_gets_its_surroundings() -> None:
    cells = np.array([[0, 0, 0], [1, 0, 0], [9, 0, 0]])
    found = surface_normals(cells, np.array([UP, [np.nan] * 3, [0.0] * 3]), 2.0, 0.9)
    np.testing.assert_allclose(found[:2], [UP, UP])
    assert np.isnan(found[2]).all()


def test_none_and_too_far_apart() -> None:
    assert surface_normals(np.empty((0, 3), np.int32), np.empty((0, 3)), 5.0, 0.9).shape == (0, 3)
    far = np.array([[0, 0, 0], [2**21, 2**21, 2**21]], dtype=np.int64)
    with pytest.raises(ValueError, match="2\\^62"):
        surface_normals(far, np.array([UP, UP]), 5.0, 0.9)
