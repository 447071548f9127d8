"""What two landmarks share, and what is left when they become one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.mapper.estimation.beliefs import Belief
from thingmap.mapper.estimation.landmarks import Landmark, volume_overlaps

TURNED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # a quarter turn about up


def make(number: int, position=(0.0, 0.0, 0.0), half_axes=(0.1, 0.2, 0.3)) -> Landmark:
    belief = Belief(2, generic_evidence_model())
    return Landmark(number, belief, np.array(position, dtype=float), np.log(half_axes), 1.0, 2.0)


def overlap(a: Landmark, b: Landmark, R: np.ndarray | None = None) -> float:
    matrix = volume_overlaps([a, b], np.eye(3) if R is None else R)
    assert matrix.shape == (2, 2) and matrix[0, 1] == pytest.approx(matrix[1, 0])
    np.testing.assert_allclose(np.diag(matrix), 1.0)
    return float(matrix[0, 1])


def test_no_landmarks_share_nothing():
    assert volume_overlaps([], np.eye(3)).shape == (0, 0)


@pytest.mark.parametrize(
    ("offset", "share"),
    [
        ((0.0, 0.0, 0.0), 1.0),
        ((0.1, 0.0, 0.0), 0.5),
        ((0.1, 0.2, 0.0), 0.25),
        ((0.0, 0.0, 0.6), 0.0),
        ((0.0, 0.0, -0.45), 0.25),
        ((9.0, 9.0, 9.0), 0.0),
    ],
)
def test_equal_boxes(offset, share):
    assert overlap(make(1), make(2, offset)) == pytest.approx(share, abs=1e-12)


def test_a_small_box_inside_a_large_one_is_covered():
    assert overlap(make(1, half_axes=(1.0, 1.0, 1.0)), make(2, (0.3, 0.2, -0.5))) == pytest.approx(1.0)


def test_boxes_lie_along_the_upright_axes():
    """0.1 m along the world's x is along the boxes' y (half axis 0.2) once they are turned."""
    assert overlap(make(1), make(2, (0.1, 0.0, 0.0)), TURNED) == pytest.approx(0.75)
    assert overlap(make(1), make(2, (0.0, 0.1, 0.0)), TURNED) == pytest.approx(0.5)


@given(data=st.data())
@settings(max_examples=30, deadline=None)
def test_shares_by_counting_points(data):
    place = st.tuples(*[st.floats(-0.4, 0.4)] * 3)
    size = st.tuples(*[st.floats(0.05, 0.4)] * 3)
    a, b = make(1, data.draw(place), data.draw(size)), make(2, data.draw(place), data.draw(size))
    small, large = sorted((a, b), key=lambda x: float(np.prod(x.half_axes)))
    steps = (np.arange(40) + 0.5) / 20.0 - 1.0
    grid = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3) * small.half_axes + small.position
    inside = (np.abs(grid - large.position) < large.half_axes).all(axis=1)
    assert overlap(a, b) == pytest.approx(inside.mean(), abs=0.08)


def test_counts_after_a_merge():
    """A keyframe in which either was seen supports the one thing; one that contradicted both still does."""
    kept, other = make(1), make(2)
    kept.supporting, kept.occluded, kept.contradicting, kept.measurements = {1, 2}, {3, 5}, {4, 6}, 4
    other.supporting, other.occluded, other.contradicting, other.measurements = {4, 7}, {1, 6, 8}, {3, 6}, 3
    other.first_seen, other.last_seen = 0.5, 1.5
    kept.count_from(other)
    assert kept.supporting == {1, 2, 4, 7}
    assert kept.contradicting == {3, 6}
    assert kept.occluded == {5, 8}
    assert kept.measurements == 7 and kept.number == 1
    assert (kept.first_seen, kept.last_seen) == (0.5, 2.0)


def test_half_axes_are_metres():
    np.testing.assert_allclose(make(1).half_axes, [0.1, 0.2, 0.3])
