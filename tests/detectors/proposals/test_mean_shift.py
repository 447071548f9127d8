"""Mean shift on voxels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.detectors.proposals.mean_shift import mean_shift


def blobs(centres: list[list[float]], count: int, spread: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    points = np.concatenate([rng.normal(centre, spread, (count, 3)) for centre in centres])
    return points, np.repeat(np.arange(len(centres)), count)


def test_blobs_apart_are_clusters():
    points, truth = blobs([[0, 0, 1], [0.5, 0, 1], [0, 0.6, 1.4]], 300, 0.02)
    found = mean_shift(points, 0.12)
    assert found.max() == 2
    for blob in range(3):
        assert len(np.unique(found[truth == blob])) == 1


def test_no_points():
    assert mean_shift(np.zeros((0, 3)), 0.1).shape == (0,)


def test_one_point_and_equal_points():
    assert mean_shift(np.ones((1, 3)), 0.1).tolist() == [0]
    assert mean_shift(np.ones((50, 3)), 0.1).tolist() == [0] * 50


def test_modes_are_those_of_the_points_not_of_the_voxels():
    # a dense end and a thin tail: by voxels alone the mode would lie in the middle of the line
    dense, tail = np.zeros((1000, 3)), np.zeros((40, 3))
    dense[:, 0] = np.linspace(0.0, 0.02, 1000)
    tail[:, 0] = np.linspace(0.02, 0.30, 40)
    found = mean_shift(np.concatenate([dense, tail]), 0.1)
    assert found[0] == 0 and found.max() >= 1
    reach = tail[found[1000:] == 0, 0].max()
    assert reach < 0.16


def exact_modes(points: np.ndarray, radius: float) -> np.ndarray:
    """Mean shift of every point by itself."""
    modes = points.copy()
    for _ in range(300):
        near = np.linalg.norm(modes[:, None] - points[None], axis=2) <= radius
        moved = near @ points / near.sum(axis=1, keepdims=True)
        if np.allclose(moved, modes, atol=1e-12):
            break
        modes = moved
    return modes


def test_against_mean_shift_without_voxels():
    points, _ = blobs([[0, 0, 0], [0.35, 0, 0], [0.1, 0.4, 0.1]], 60, 0.03, seed=3)
    modes = exact_modes(points, 0.15)
    same = np.linalg.norm(modes[:, None] - modes[None], axis=2) < 0.15
    found = mean_shift(points, 0.15, 6)
    assert np.array_equal(found[:, None] == found[None], same)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 200))
def test_every_point_has_a_cluster_and_numbers_have_no_gaps(seed: int, count: int):
    points = np.random.default_rng(seed).uniform(-0.5, 0.5, (count, 3))
    found = mean_shift(points, 0.1)
    assert np.array_equal(np.unique(found), np.arange(found.max() + 1))
    assert np.array_equal(found, mean_shift(points, 0.1))


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_scale_does_not_matter(factor: float):
    points, _ = blobs([[0, 0, 1], [0.5, 0, 1]], 200, 0.05)
    assert np.array_equal(mean_shift(points, 0.12), mean_shift(points * factor, 0.12 * factor))
