"""Decoding against boxes worked out by hand, and suppression."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thingmap.detectors.onnx.outputs import OutputFamily, decode, family_of
from thingmap.detectors.onnx.suppression import suppress

# An input of 96 x 64 has grids of 12x8, 6x4 and 3x2 cells: 96 + 24 + 6 = 126.
WIDTH, HEIGHT, CELLS = 96, 64, 126


@pytest.mark.parametrize(
    ("shape", "family", "classes"),
    [
        ((1, CELLS, 85), OutputFamily.YOLOX, 80),
        ((1, CELLS, 6), OutputFamily.YOLOX, 1),
        ((1, 3 * CELLS, 85), OutputFamily.YOLOV5, 80),
        ((1, 84, CELLS), OutputFamily.YOLOV8, 80),
        ((1, 5, CELLS), OutputFamily.YOLOV8, 1),
    ],
)
def test_family_by_shape(shape, family, classes):
    assert family_of(shape, WIDTH, HEIGHT) is family
    assert family.class_count(shape) == classes


@pytest.mark.parametrize(
    "shape", [(1, 300, 6), (CELLS, 85), (2, CELLS, 85), (1, CELLS, 5), (1, 4, CELLS), (1, 32, 16, 24)]
)
def test_shapes_of_no_family(shape):
    assert family_of(shape, WIDTH, HEIGHT) is None


def test_real_sizes():
    assert family_of((1, 3549, 85), 416, 416) is OutputFamily.YOLOX
    assert family_of((1, 8400, 85), 640, 640) is OutputFamily.YOLOX
    assert family_of((1, 25200, 85), 640, 640) is OutputFamily.YOLOV5
    assert family_of((1, 84, 8400), 640, 640) is OutputFamily.YOLOV8


def test_yolox_cell_by_cell():
    output = np.zeros((1, CELLS, 7), dtype=np.float32)
    # Finest grid, row 2, column 5: cell 2 * 12 + 5 of stride 8, centre half a cell further, 2 x 4 cells large.
    output[0, 29] = [0.5, 0.5, np.log(2.0), np.log(4.0), 0.5, 0.8, 0.1]
    # Middle grid, row 1, column 3: after 96 cells, 1 * 6 + 3 of stride 16.
    output[0, 96 + 9] = [0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0]
    # Coarsest grid, last cell: row 1, column 2 of stride 32.
    output[0, 125] = [0.0, 0.0, np.log(0.5), 0.0, 0.25, 1.0, 0.5]
    xyxy, scores = decode(output, OutputFamily.YOLOX, WIDTH, HEIGHT)
    assert xyxy.shape == (CELLS, 4) and scores.shape == (CELLS, 2)
    np.testing.assert_allclose(xyxy[29], [44 - 8, 20 - 16, 44 + 8, 20 + 16], rtol=1e-6)
    np.testing.assert_allclose(xyxy[105], [48 - 8, 32 - 8, 48 + 8, 32 + 8], rtol=1e-6)
    np.testing.assert_allclose(xyxy[125], [64 - 8, 32 - 16, 64 + 8, 32 + 16], rtol=1e-6)
    np.testing.assert_allclose(scores[[29, 105, 125]], [[0.4, 0.05], [0.0, 1.0], [0.25, 0.125]], rtol=1e-6)


def test_yolox_of_a_mad_size_stays_finite():
    output = np.full((1, CELLS, 6), 1e4, dtype=np.float32)
    assert np.isfinite(decode(output, OutputFamily.YOLOX, WIDTH, HEIGHT)[0]).all()


def test_decoded_layouts():
    row = np.array([30.0, 20.0, 10.0, 8.0, 0.5, 0.5, 1.0], dtype=np.float32)
    for family, count in ((OutputFamily.YOLOX_DECODED, CELLS), (OutputFamily.YOLOV5, 3 * CELLS)):
        xyxy, scores = decode(np.tile(row, (1, count, 1)), family, WIDTH, HEIGHT)
        assert xyxy.shape == (count, 4)
        assert xyxy[-1].tolist() == [25, 16, 35, 24] and scores[-1].tolist() == [0.25, 0.5]


def test_yolov8_is_transposed_and_has_no_objectness():
    output = np.zeros((1, 6, CELLS), dtype=np.float32)
    output[0, :, 7] = [30, 20, 10, 8, 0.5, 0.25]
    xyxy, scores = decode(output, OutputFamily.YOLOV8, WIDTH, HEIGHT)
    assert xyxy[7].tolist() == [25, 16, 35, 24] and scores[7].tolist() == [0.5, 0.25]
    assert not scores[[6, 8]].any()


def test_suppression_by_hand():
    boxes = np.array([[0, 0, 10, 10], [0, 0, 10, 6], [0, 0, 10, 4], [20, 20, 30, 30]], dtype=float)
    confidence = np.array([0.5, 0.9, 0.7, 0.6])
    # Against the second (best): IoU of the first is 60/100, of the third 40/60.
    assert suppress(boxes, confidence, 0.65, 10).tolist() == [1, 3, 0]
    assert suppress(boxes, confidence, 0.5, 10).tolist() == [1, 3]
    assert suppress(boxes, confidence, 1.0, 10).tolist() == [1, 2, 3, 0]
    assert suppress(boxes, confidence, 0.65, 2).tolist() == [1, 3]
    assert suppress(boxes[:0], confidence[:0], 0.5, 10).tolist() == []


def test_of_equal_scores_the_first_wins():
    boxes = np.array([[0, 0, 10, 10], [0, 0, 10, 10], [0, 0, 10, 10]], dtype=float)
    assert suppress(boxes, np.full(3, 0.5), 0.5, 10).tolist() == [0]


@given(arrays(np.float64, (12, 4), elements=st.integers(0, 20)), arrays(np.float64, 12, elements=st.floats(0, 1)))
def test_suppression_keeps_apart_and_covers(raw: np.ndarray, confidence: np.ndarray):
    boxes = np.concatenate([np.minimum(raw[:, :2], raw[:, 2:]), np.maximum(raw[:, :2], raw[:, 2:])], axis=1)
    kept = suppress(boxes, confidence, 0.5, 100)
    assert (np.diff(confidence[kept]) <= 0).all()
    for i in range(12):
        over = [k for k in kept if k != i and overlap(boxes[i], boxes[k]) > 0.5]
        if i in kept:
            assert not over
        else:
            assert any(confidence[k] >= confidence[i] for k in over)


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union of two boxes, 0 for two empty ones."""
    side = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])
    inter = float(np.prod(np.maximum(side, 0)))
    union = float(np.prod(a[2:] - a[:2]) + np.prod(b[2:] - b[:2])) - inter
    return inter / union if union > 0 else 0.0
