"""Packing masks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from thingmap.detectors.recorded.run_lengths import RunLengths


def test_runs_go_down_the_columns_and_start_with_background():
    masks = np.array([[[0, 1, 1], [0, 0, 1]], [[1, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 0, 0]]], dtype=bool)
    packed = RunLengths.encode(masks).to_json()
    assert packed == {"size": [2, 3], "counts": [[2, 1, 1, 2], [0, 2, 4], [6]]}


@given(arrays(bool, array_shapes(min_dims=3, max_dims=3, max_side=7)))
def test_masks_come_back(masks: np.ndarray):
    np.testing.assert_array_equal(RunLengths.from_json(RunLengths.encode(masks).to_json()).decode(), masks)


@given(st.sampled_from([(0, 4, 5), (2, 0, 5), (1, 3, 0)]))
def test_empty_masks_come_back(shape: tuple[int, int, int]):
    assert RunLengths.from_json(RunLengths.encode(np.zeros(shape, dtype=bool)).to_json()).decode().shape == shape


@pytest.mark.parametrize("counts", [[5], [7], [8, -2], [2.5, 3.5], [[6]]])
def test_runs_that_are_no_mask(counts: list):
    with pytest.raises(ValueError, match="add up to 2 x 3"):
        RunLengths((2, 3), (np.array(counts),))
