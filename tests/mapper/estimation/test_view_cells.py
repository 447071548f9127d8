"""Looks from one place are averaged and count as hardly more than one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.mapper.config import BeliefConfig
from thingmap.mapper.estimation.view_cells import MAX_CELLS, NEW_CELL, ViewCells

CONFIG = BeliefConfig(view_angle=0.17, view_log_range=0.3, repeat_correlation=0.8)
RHO = CONFIG.repeat_correlation
QUICK = settings(max_examples=40, deadline=None)
ONE = np.array([1.0])


def make(columns: int = 1) -> ViewCells:
    return ViewCells((columns,), CONFIG)


def at(angle: float, distance: float = 2.0) -> np.ndarray:
    """(3,) on a circle about the object, from an angle in rad."""
    return distance * np.array([np.cos(angle), np.sin(angle), 0.0])


def views(n: float) -> float:
    return n / (1.0 + RHO * (n - 1.0))


def test_nothing_was_said_yet():
    cells = make(3)
    assert len(cells) == 0 and cells.totals().tolist() == [0.0, 0.0, 0.0]
    assert cells.find(at(0.0)) == (0, 1.0)


@pytest.mark.parametrize("n", [1, 2, 5, 30, 10_000])
def test_repeated_looks_count_as_kish_says(n):
    cells = make()
    for _ in range(n):
        cells.add(at(0.3), ONE, ONE)
    assert cells.totals() == pytest.approx([views(n)])
    assert len(cells) == 1


def test_repeated_looks_are_averaged():
    cells = make(2)
    for said in ([1.0, 0.0], [0.0, 3.0], [1.0, 0.0], [1.0, 0.0]):
        cells.add(at(0.0), ONE, np.array(said))
    np.testing.assert_allclose(cells.totals(), views(4) * np.array([0.75, 0.75]))


def test_independent_places_add_up():
    cells = make()
    for angle in (0.0, 0.5, 1.0):
        cells.add(at(angle), ONE, ONE)
    cells.add(at(0.0, 4.0), ONE, ONE)  # twice as far is another view too
    assert cells.totals() == pytest.approx([4.0]) and len(cells) == 4


def test_half_an_angle_away_counts_half():
    cells = make()
    cells.add(at(0.0), ONE, ONE)
    cell, weight = cells.find(at(0.5 * CONFIG.view_angle))
    assert (cell, weight) == (1, pytest.approx(0.5))
    cells.add(at(0.5 * CONFIG.view_angle), ONE, ONE)
    assert cells.totals() == pytest.approx([1.5])


def test_half_a_log_range_away_counts_half():
    cells = make()
    cells.add(at(0.0), ONE, ONE)
    assert cells.find(at(0.0, 2.0 * np.exp(-0.5 * CONFIG.view_log_range)))[1] == pytest.approx(0.5)


def test_hardly_moved_is_the_same_place():
    cells = make()
    cells.add(at(0.0), ONE, ONE)
    near = at(0.9 * NEW_CELL * CONFIG.view_angle)
    assert cells.find(near)[0] == 0
    cells.add(near, ONE, ONE)
    assert len(cells) == 1 and cells.totals() == pytest.approx([views(2)])


@given(angles=st.lists(st.floats(0.0, 6.2), max_size=30))
@QUICK
def test_the_weight_of_a_look_is_what_it_adds(angles):
    cells = make()
    for angle in angles:
        before, (cell, weight) = cells.totals()[0], cells.find(at(angle))
        assert 0.0 <= weight <= 1.0 and 0 <= cell <= len(cells)
        cells.add(at(angle), ONE, ONE)
        assert cells.totals()[0] - before == pytest.approx(weight)


@given(
    looks=st.lists(st.tuples(st.integers(0, 5), st.floats(-3.0, 3.0)), max_size=30),
    order=st.randoms(use_true_random=False),
)
@QUICK
def test_the_order_of_looks_does_not_matter(looks, order):
    shuffled = list(looks)
    order.shuffle(shuffled)
    totals = []
    for each in (looks, shuffled):
        cells = make(2)
        for where, said in each:
            cells.add(at(where), ONE, np.array([1.0, said]))
        totals.append(cells.totals())
    np.testing.assert_allclose(totals[0], totals[1], atol=1e-9)


@given(
    own=st.lists(st.tuples(st.integers(0, 5), st.floats(-3.0, 3.0)), max_size=12),
    others=st.lists(st.tuples(st.integers(0, 5), st.floats(-3.0, 3.0)), max_size=12),
)
@QUICK
def test_absorbed_looks_count_as_one_s_own(own, others):
    """From places that are the same or independent."""
    kept, absorbed, both = make(), make(), make()
    for cells, looks in ((kept, own), (absorbed, others), (both, own + others)):
        for where, said in looks:
            cells.add(at(where), ONE, np.array([said]))
    kept.absorb(absorbed)
    np.testing.assert_allclose(kept.totals(), both.totals(), atol=1e-9)
    assert len(kept) == len(both)


def test_memory_is_bounded_and_nothing_is_lost():
    rng, cells = np.random.default_rng(0), make(1)
    for place in rng.normal(size=(2000, 3)):
        cells.add(place, ONE, ONE)
    assert len(cells) == MAX_CELLS
    assert cells.totals()[0] <= MAX_CELLS / RHO
    before = cells.totals()[0]
    cells.add(rng.normal(size=3), ONE, 1000.0 * ONE)
    assert cells.totals()[0] > before
    other = make(1)
    for place in rng.normal(size=(2000, 3)):
        other.add(place, ONE, ONE)
    cells.absorb(other)
    assert len(cells) == MAX_CELLS


def test_a_camera_inside_the_object_is_survived():
    cells = make()
    assert cells.find(np.zeros(3)) == (0, 1.0)
    cells.add(np.zeros(3), ONE, ONE)
    cell, weight = cells.find(np.array([1.0, 0.0, 0.0]))
    assert cell in (0, 1) and np.isfinite(weight)
    cells.add(np.array([1.0, 0.0, 0.0]), ONE, ONE)
    assert np.isfinite(cells.totals()).all()


def test_groups_count_their_own_looks():
    """Three looks, of which one scored, and depth told of half each time."""
    cells = ViewCells((1, 1), CONFIG)
    for scored in (1.0, 0.0, 0.0):
        cells.add(at(0.0), np.array([scored, 0.5]), np.array([4.0 * scored, 0.5 * 2.0]))
    np.testing.assert_allclose(cells.totals(), [4.0, 2.0 * views(1.5)])
    np.testing.assert_allclose(cells.views(), [1.0, views(1.5)])


@given(mass=st.floats(0.0, 1.0), said=st.floats(-3.0, 3.0))
@QUICK
def test_less_than_one_look_counts_as_itself(mass, said):
    cells = make()
    cells.add(at(0.0), np.array([mass]), np.array([mass * said]))
    np.testing.assert_allclose(cells.totals(), [mass * said], atol=1e-9)


def test_looks_are_placed_anew_by_their_keyframes():
    """Cameras move, the object too: a look from keyframe t is one from where t is now, with the same number."""
    cells, before = make(), np.array([at(0.0), at(1.0), at(2.0)])
    for keyframe in (1, 2, 0):
        cells.add(before[keyframe], ONE, (keyframe + 1.0) * ONE, keyframe)
    said = cells.totals()
    cameras, position = np.array([at(4.0), at(5.0, 4.0), at(3.0)]), np.array([0.5, 0.0, 0.2])
    cells.place_anew(cameras, position)
    for cell, keyframe in enumerate((1, 2, 0)):
        assert cells.find(cameras[keyframe] - position)[0] == cell
    assert cells.find(before[1])[1] == 1.0  # nobody has looked from there now
    np.testing.assert_array_equal(cells.totals(), said)


def test_a_look_of_an_unknown_keyframe_stays_where_it_was():
    cells = make()
    cells.add(at(0.0), ONE, ONE)
    cells.place_anew(np.array([at(2.0)]), np.zeros(3))
    assert cells.find(at(0.0))[0] == 0 and cells.find(at(2.0))[0] == 1


def test_absorbed_looks_keep_their_keyframes():
    cells, other = make(), make()
    cells.add(at(0.0), ONE, ONE, 0)
    other.add(at(1.0), ONE, ONE, 1)
    cells.absorb(other)
    cells.place_anew(np.array([at(3.0), at(4.0)]), np.zeros(3))
    assert [cells.find(at(angle))[0] for angle in (3.0, 4.0)] == [0, 1]


def test_what_a_keyframe_said_from_somewhere_new_can_be_taken_back():
    cells = make(2)
    for keyframe, angle in enumerate((0.0, 1.0, 2.0)):
        cells.add(at(angle), ONE, np.array([1.0, keyframe]), keyframe)
    cells.add(at(3.0), ONE, np.array([1.0, 10.0]))
    cells.forget({1, 7, -1})
    assert len(cells) == 3
    np.testing.assert_allclose(cells.totals(), [3.0, 0.0 + 2.0 + 10.0])
    assert cells.find(at(1.0)) == (3, 1.0)
