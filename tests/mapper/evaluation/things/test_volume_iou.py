import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.mapper.evaluation.things.volume_iou import box_row, box_rows, volume_iou, volume_ious
from thingmap.mapper.map.boxes import inside_box
from thingmap.mapper.map.upright import upright_rotation


def box(x=0.0, y=0.0, z=0.0, size=(1.0, 1.0, 1.0), yaw=0.0):
    return np.array([x, y, z, *size, yaw])


lengths = st.floats(0.01, 2.0)
boxes = st.builds(
    lambda x, y, z, size, yaw: box(x, y, z, size, yaw),
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
    st.tuples(lengths, lengths, lengths),
    st.floats(-7.0, 7.0),
)


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (box(0.5), 1 / 3),  # half shared
        (box(0.5, 0.5, 0.5), 0.125 / 1.875),
        (box(1.0), 0.0),  # they touch
        (box(z=1.5), 0.0),
        (box(size=(0.5, 0.5, 0.5), yaw=0.3), 0.125),  # wholly inside
        (box(yaw=np.pi / 2), 1.0),
        # a unit square turned by 45 degrees shares an octagon of area 2 (sqrt(2) - 1) with the upright one
        (box(yaw=np.pi / 4), 2 * (np.sqrt(2) - 1) / (2 - 2 * (np.sqrt(2) - 1))),
        # a corner at 45 degrees enters by 0.2 from the side: a triangle of area 0.2^2
        (box(0.5 + np.sqrt(0.5) - 0.2, yaw=np.pi / 4), 0.04 / 1.96),
    ],
)
def test_closed_forms(other, expected):
    assert volume_iou(box(), other) == pytest.approx(expected, abs=1e-14)


def test_long_boxes_that_cross():
    a, b = box(size=(2.0, 0.1, 1.0)), box(size=(2.0, 0.1, 1.0), yaw=np.pi / 2)
    assert volume_iou(a, b) == pytest.approx(0.01 / 0.39, abs=1e-14)


def test_agrees_with_counting_points():
    rng = np.random.default_rng(5)
    points = rng.uniform(-1.0, 1.0, (400_000, 3))
    for _ in range(5):
        a, b = (box(*rng.uniform(-0.2, 0.2, 3), rng.uniform(0.3, 1.1, 3), rng.uniform(-3, 3)) for _ in range(2))
        inside = [inside_box(points, row[:3], row[3:6], row[6], np.eye(3)) for row in (a, b)]
        counted = np.sum(inside[0] & inside[1]) / np.sum(inside[0] | inside[1])
        assert volume_iou(a, b) == pytest.approx(counted, abs=0.01)


@given(boxes, boxes)
@settings(max_examples=200, deadline=None)
def test_is_symmetric_and_a_share(a, b):
    value = volume_iou(a, b)
    assert 0.0 <= value <= 1.0
    assert volume_iou(b, a) == pytest.approx(value, abs=1e-10)


@given(boxes, boxes, st.floats(-3.0, 3.0), st.tuples(*[st.floats(-3.0, 3.0)] * 3))
@settings(max_examples=200, deadline=None)
def test_moving_both_changes_nothing(a, b, angle, shift):
    def moved(row):
        cosine, sine = np.cos(angle), np.sin(angle)
        x, y = cosine * row[0] - sine * row[1], sine * row[0] + cosine * row[1]
        return np.array([x + shift[0], y + shift[1], row[2] + shift[2], *row[3:6], row[6] + angle])

    assert volume_iou(moved(a), moved(b)) == pytest.approx(volume_iou(a, b), abs=1e-9)


@given(boxes, st.integers(-4, 4))
@settings(max_examples=200, deadline=None)
def test_a_box_is_itself_however_its_axes_are_named(a, quarters):
    b = a.copy()
    b[6] += quarters * np.pi / 2
    if quarters % 2:
        b[3], b[4] = a[4], a[3]
    assert volume_iou(a, b) == pytest.approx(1.0, abs=1e-9)


def test_all_pairs_and_what_has_no_volume_or_no_size():
    unknown = box(size=(np.nan, 1.0, 1.0))
    flat = box(size=(1.0, 1.0, 0.0))
    found = volume_ious(np.stack([box(), flat]), np.stack([box(0.5), unknown, flat]))
    np.testing.assert_allclose(found, [[1 / 3, np.nan, 0.0], [0.0, np.nan, 0.0]])
    assert volume_ious(np.zeros((0, 7)), np.stack([box()])).shape == (0, 1)


def test_rows_are_in_upright_axes():
    R = upright_rotation(np.array([0.0, -1.0, 0.2]))
    position = np.array([0.3, -0.2, 1.5])
    row = box_row(position, np.array([0.1, 0.2, 0.3]), 0.4, R)
    np.testing.assert_allclose(R @ row[:3], position)
    np.testing.assert_allclose(row[3:], [0.1, 0.2, 0.3, 0.4])
    higher = box_row(position + 0.1 * R[:, 2], np.array([0.1, 0.2, 0.3]), 0.4, R)
    assert volume_iou(row, higher) == pytest.approx(0.5)
    assert box_rows([], R).shape == (0, 7)
