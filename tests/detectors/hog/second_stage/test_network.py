"""The network of the second stage."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.detectors.hog.second_stage.network import (
    LIMIT,
    MOST_SHIFT,
    WindowNetwork,
    _product,
    box_offsets,
    moved_boxes,
)


def network(seed: int = 0, inputs: int = 7, hidden: int = 4, classes: int = 2) -> WindowNetwork:
    rng = np.random.default_rng(seed)
    sizes = [inputs, hidden, classes + 5]
    weights = tuple(rng.normal(size=shape).astype(np.float32) for shape in pairwise(sizes))
    biases = tuple(rng.normal(size=size).astype(np.float32) for size in sizes[1:])
    centre, spread = rng.normal(size=inputs), rng.uniform(0.5, 2.0, inputs)
    return WindowNetwork(centre.astype(np.float32), spread.astype(np.float32), weights, biases)


def test_outputs_are_those_of_the_layers():
    net, views = network(), np.random.default_rng(1).normal(size=(9, 7)).astype(np.float32)
    views[0] = 1e6  # clipped
    first = np.clip((views - net.centre) / net.spread, -LIMIT, LIMIT) @ net.weights[0] + net.biases[0]
    np.testing.assert_allclose(
        net.outputs(views), np.maximum(first, 0.0) @ net.weights[1] + net.biases[1], rtol=1e-4, atol=1e-4
    )
    assert (net.inputs, net.classes) == (7, 2)


def test_probabilities_leave_the_backgrounds():
    net, views = network(), np.random.default_rng(1).normal(size=(9, 7)).astype(np.float32)
    boxes = np.tile([10.0, 20.0, 30.0, 60.0], (9, 1))
    p, xyxy = net.judge(views, boxes)
    z = net.outputs(views).astype(np.float64)
    share = np.exp(z[:, 2]) / np.exp(z[:, :3]).sum(axis=1)
    np.testing.assert_allclose(p.sum(axis=1), 1.0 - share, atol=1e-6)
    np.testing.assert_allclose(xyxy, moved_boxes(boxes, z[:, 3:]), atol=1e-4)


def test_no_windows():
    p, xyxy = network().judge(np.zeros((0, 7), np.float32), np.zeros((0, 4)))
    assert p.shape == (0, 2) and xyxy.shape == (0, 4)


@given(st.integers(0, 1000), st.integers(1, 40), st.integers(1, 700), st.integers(1, 70))
def test_a_product_in_pieces_is_a_product(seed: int, rows: int, inner: int, columns: int):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(rows, inner)).astype(np.float32), rng.normal(size=(inner, columns)).astype(np.float32)
    np.testing.assert_allclose(_product(a, b), a.astype(np.float64) @ b, rtol=1e-3, atol=1e-3)


@given(st.integers(0, 1000))
def test_offsets_make_the_true_box(seed: int):
    rng = np.random.default_rng(seed)
    corner, size = rng.uniform(0.0, 300.0, (5, 2)), rng.uniform(10.0, 90.0, (5, 2))
    boxes = np.concatenate([corner, corner + size], axis=1)
    middle = corner + size * rng.uniform(0.1, 0.9, (5, 2))
    half = 0.5 * size * rng.uniform(0.4, 2.5, (5, 2))
    true = np.concatenate([middle - half, middle + half], axis=1)
    np.testing.assert_allclose(moved_boxes(boxes, box_offsets(boxes, true)), true, atol=1e-6)


def test_a_box_does_not_leave_its_window_behind():
    box = np.array([[100.0, 100.0, 140.0, 180.0]])
    far = moved_boxes(box, np.array([[9.0, -9.0, 0.0, 0.0]]))
    np.testing.assert_allclose(far, box + np.array([40, -80, 40, -80]) * MOST_SHIFT)


def test_there_and_back():
    net = network()
    back = WindowNetwork.of_arrays(net.arrays(), 2)
    for old, new in zip(net.weights, back.weights, strict=True):
        assert (np.abs(new - old) <= 0.501 * np.abs(old).max(axis=0) / 127).all()  # half a step of each unit
        assert new.dtype == np.float32
    for old, new in zip(net.biases, back.biases, strict=True):
        np.testing.assert_array_equal(new, old)
    again = WindowNetwork.of_arrays(back.arrays(), 2)
    for old, new in zip(back.weights, again.weights, strict=True):
        np.testing.assert_allclose(new, old, rtol=1e-6, atol=1e-9)
    plain = net.arrays() | {f"second_weights_{k}": layer for k, layer in enumerate(net.weights)}
    np.testing.assert_array_equal(WindowNetwork.of_arrays(plain, 2).weights[0], net.weights[0])  # steps are for 8 bits
    with pytest.raises(KeyError, match="second_weights_2"):
        WindowNetwork.of_arrays(net.arrays(), 3)


@pytest.mark.parametrize("spoil", ["layers", "bias", "spread", "nan"])
def test_what_does_not_fit_is_refused(spoil: str):
    net = network()
    weights, biases, spread = list(net.weights), list(net.biases), net.spread.copy()
    if spoil == "layers":
        weights[1] = weights[1][1:]
    elif spoil == "bias":
        biases[0] = biases[0][1:]
    elif spoil == "spread":
        spread[0] = 0.0
    else:
        weights[0][0, 0] = np.nan
    with pytest.raises(ValueError, match=r"layers|spread|finite"):
        WindowNetwork(net.centre, spread, tuple(weights), tuple(biases))
