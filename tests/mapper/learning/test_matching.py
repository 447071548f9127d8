import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.mapper.learning.matching import match

UNKNOWN = np.full((1, 4), np.nan)


def run(boxes, whole, seen=None, part=None, overlap=0.4):
    boxes, whole = np.array(boxes, dtype=float).reshape(-1, 4), np.array(whole, dtype=float).reshape(-1, 4)
    seen = np.full(whole.shape, np.nan) if seen is None else np.array(seen, dtype=float)
    part = np.zeros(len(boxes), dtype=int) if part is None else np.array(part)
    return match(boxes, part, whole, seen, overlap)


def test_the_closest_of_two_overlapping_objects_is_taken():
    whole = [[0, 0, 10, 10], [3, 0, 13, 10]]
    matches = run([[1, 0, 11, 10], [2.5, 0, 12.5, 10]], whole)
    assert matches.object.tolist() == [0, 1]
    assert matches.detection[:, 0].tolist() == [0, 1]
    assert not matches.duplicate.any()


def test_of_two_boxes_on_one_object_the_better_one_shows_it_and_the_other_is_no_false_detection():
    matches = run([[2, 0, 12, 10], [0, 0, 10, 11]], [[0, 0, 10, 10]])
    assert matches.object.tolist() == [0, 0]
    assert matches.duplicate.tolist() == [True, False]
    assert matches.detection[0, 0] == 1


@pytest.mark.parametrize(("shift", "object_"), [(4.0, 0), (5.0, -1)])
def test_overlap_has_to_be_significant(shift, object_):
    assert run([[shift, 0, 10 + shift, 10]], [[0, 0, 10, 10]]).object.tolist() == [object_]  # IoU 0.43 and 0.33


def test_a_box_of_what_can_be_seen_counts_too():
    box, whole, seen = [[0, 0, 3, 10]], [[0, 0, 10, 10]], [[0, 0, 2.5, 10]]
    assert run(box, whole).object.tolist() == [-1]
    assert run(box, whole, seen).object.tolist() == [0]


def test_a_half_is_compared_with_the_half_of_the_object():
    whole, left = [[0, 0, 10, 10]], [0, 0, 5, 10]
    matches = run([left, left, left], whole, part=[3, 4, 0])
    assert matches.object.tolist() == [0, -1, 0]  # half the object overlaps the whole by 0.5, the right half not at all
    assert matches.detection[0].tolist() == [2, -1, -1, 0, -1]


def test_objects_out_of_view_and_empty_frames():
    assert run([[0, 0, 1, 1]], UNKNOWN).object.tolist() == [-1]
    assert run([], [[0, 0, 1, 1]]).detection.tolist() == [[-1] * 5]
    assert run([[0, 0, 1, 1]], []).object.tolist() == [-1]


corner = st.tuples(st.integers(0, 30), st.integers(0, 30), st.integers(1, 20), st.integers(1, 20))
boxes = st.lists(corner.map(lambda c: [c[0], c[1], c[0] + c[2], c[1] + c[3]]), max_size=6)


@given(boxes, boxes)
def test_one_detection_an_object_and_template(found, things):
    matches = run(found, things, part=[k % 5 for k in range(len(found))])
    for m, row in enumerate(matches.detection):
        for template, n in enumerate(row):
            if n >= 0:
                assert matches.object[n] == m and n % 5 == template and not matches.duplicate[n]
    shown = matches.object >= 0
    assert (matches.detection >= 0).sum() == (shown & ~matches.duplicate).sum()
    assert not matches.duplicate[~shown].any()
