import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.detectors.detections import Part
from thingmap.detectors.hog.training.config import TrainConfig
from thingmap.detectors.hog.training.windows import class_windows, part_share, window_shape
from thingmap.detectors.parts import part_box

sides = st.floats(5.0, 200.0)
boxes = st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50), sides, sides), min_size=1, max_size=8).map(
    lambda rows: np.array([(x, y, x + w, y + h) for x, y, w, h in rows])
)


@given(boxes, st.integers(16, 100), st.floats(0.0, 0.2))
def test_a_window_contains_its_box_with_the_margin_and_has_the_aspect_of_its_cells(xyxy, cells, margin):
    shape = window_shape(xyxy, cells, margin, 0.9)
    window = shape.around(xyxy)
    room = margin * np.tile(window[:, 2:] - window[:, :2], 2) * [1, 1, -1, -1]
    inside = (xyxy - window - room) * [1, 1, -1, -1]
    assert (inside >= -1e-6 * np.abs(window).max()).all()
    size = window[:, 2:] - window[:, :2]
    np.testing.assert_allclose(size[:, 0] / size[:, 1], shape.columns / shape.rows)
    assert shape.rows % 2 == 0 and shape.columns % 2 == 0 and min(shape.rows, shape.columns) >= 4


def test_the_tightest_window_of_equal_boxes_is_the_box():
    shape = window_shape(np.array([[0, 0, 30, 60], [5, 5, 55, 105]]), 32, 0.0, 0.9)
    assert (shape.rows, shape.columns) == (8, 4)
    np.testing.assert_allclose(shape.around(np.array([10.0, 10.0, 40.0, 70.0])), [10, 10, 40, 70])


def test_objects_of_equal_area_have_windows_of_equal_size():
    xyxy = np.array([[0, 0, 40, 90], [0, 0, 60, 60], [0, 0, 90, 40.0]])
    window = window_shape(xyxy, 64, 0.1, 1.0).around(xyxy)
    np.testing.assert_allclose(window[:, 2] - window[:, 0], window[0, 2] - window[0, 0])


def test_an_odd_box_does_not_widen_the_window_of_all():
    usual = np.tile([0.0, 0.0, 30.0, 60.0], (40, 1))
    odd = np.array([[0.0, 0.0, 200.0, 20.0]])
    alone, both = (window_shape(boxes, 64, 0.1, 0.9) for boxes in (usual, np.concatenate([usual, odd])))
    assert (alone.rows, alone.columns) == (both.rows, both.columns)
    window = both.around(odd)[0]
    assert window[0] <= 0.0 and window[2] >= 200.0


def test_wide_and_tall_views_of_a_class_get_windows_of_their_own():
    tall, square, wide = (np.tile([0.0, 0.0, w, h], (20, 1)) for w, h in ((20, 80), (40, 40), (80, 20)))
    boxes = np.concatenate([tall, square, wide])
    windows = class_windows(boxes, TrainConfig(aspects=2.5, most_windows=3))
    np.testing.assert_array_equal(windows.number(boxes), np.repeat([0, 1, 2], 20))
    first, middle, last = windows.shapes
    assert first.rows > 2 * first.columns and middle.rows == middle.columns and last.columns > 2 * last.rows
    assert len(class_windows(tall, TrainConfig()).shapes) == 1
    assert len(class_windows(np.concatenate([tall, wide[:3]]), TrainConfig(fit=1.0)).shapes) == 1


def test_halves_are_cut_from_the_whole():
    shape = window_shape(np.array([[0, 0, 30, 60.0]]), 64, 0.1, 0.9)
    rows, columns = np.mgrid[: shape.rows, : shape.columns]
    for part in Part:
        cut = np.stack([rows[shape.cells(part)], columns[shape.cells(part)]], axis=-1).reshape(-1, 2)
        x0, y0, x1, y1 = part_box(np.array([0, 0, shape.columns, shape.rows]), part)
        assert len(cut) == (x1 - x0) * (y1 - y0)
        np.testing.assert_array_equal(cut.min(axis=0), [y0, x0])


def test_the_share_of_a_half_is_the_halves_box_in_the_halves_window():
    window, xyxy = np.array([[0.0, 0.0, 100.0, 80.0]]), np.array([[10.0, 20.0, 90.0, 60.0]])
    assert part_share(Part.WHOLE, window, xyxy) == pytest.approx((0.1, 0.25, 0.9, 0.75))
    assert part_share(Part.LEFT, window, xyxy) == pytest.approx((0.2, 0.25, 1.0, 0.75))
    assert part_share(Part.BOTTOM, window, xyxy) == pytest.approx((0.1, 0.0, 0.9, 0.5))
