"""Depth without holes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.detectors.hog.depth_fill import filled


def slowly_filled(depth: np.ndarray) -> np.ndarray:
    """Round after round over all pixels."""
    out = np.where(np.isfinite(depth) & (depth > 0), depth, 0.0).astype(np.float32)
    while (out == 0).any() and out.any():
        before = np.pad(out, 1)
        for y, x in np.argwhere(out == 0):
            near = before[y : y + 3, x : x + 3]
            near = np.sort(near[near > 0])
            if len(near):
                out[y, x] = near[len(near) // 2]
    return out


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.integers(1, 14), st.integers(1, 14))
@settings(max_examples=80, deadline=None)
def test_it_is_the_slow_one(seed: int, missing: float, rows: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.3, 8.0, (rows, columns)).astype(np.float32)
    depth[rng.random(depth.shape) < missing] = rng.choice([0.0, np.nan, np.inf, -2.0])
    depth[: rows // 2, : columns // 2] = 0.0  # a hole of several rounds
    given_depth = depth.copy()
    np.testing.assert_array_equal(filled(depth), slowly_filled(depth))
    np.testing.assert_array_equal(depth, given_depth)


def test_what_is_known_stays_and_the_rest_gets_values_that_occur() -> None:
    rng = np.random.default_rng(5)
    depth = rng.uniform(0.5, 4.0, (60, 80)).astype(np.float32)
    depth[10:40, 20:70] = 0.0
    depth[rng.random(depth.shape) < 0.3] = 0.0
    out = filled(depth)
    known = depth > 0
    np.testing.assert_array_equal(out[known], depth[known])
    assert np.isin(out, depth[known]).all()


def test_a_hole_beside_an_edge_is_background() -> None:
    depth = np.full((5, 4), 3.0, np.float32)
    depth[:, 0] = 1.0
    depth[:, 1] = 0.0
    assert (filled(depth)[:, 1] == 3.0).all()  # as many neighbours are near as are far


def test_it_keeps_edges() -> None:
    depth = np.full((40, 40), 1.0, np.float32)
    depth[:, 20:] = 2.0
    depth[15:25, 10:30] = 0.0
    assert set(np.unique(filled(depth))) == {1.0, 2.0}


@pytest.mark.parametrize("nothing", [0.0, np.nan, np.inf])
@pytest.mark.parametrize("shape", [(6, 9), (1, 1), (0, 0)])
def test_nothing_known(nothing: float, shape: tuple[int, int]) -> None:
    out = filled(np.full(shape, nothing))
    assert out.shape == shape and out.dtype == np.float32 and not out.any()
