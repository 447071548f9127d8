from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.datasets.truth import TrueObject
from thingmap.mapper.evaluation.things.matching import (
    assign,
    believed,
    match_by_distance,
    match_by_volume,
    match_ranked,
    places_all,
    reaches,
)


@pytest.fixture
def case(scene_truth, perfect_run, make_case):
    return make_case(perfect_run(scene_truth), scene_truth)


def all_count(case):
    return np.ones(len(case.truth.located), dtype=bool)


def moved(thing, shift):
    return replace(thing, position=thing.position + np.asarray(shift))


def test_as_many_pairs_as_possible_come_before_near_ones():
    # The first row is nearest to column 0, but only column 0 is allowed for the second.
    cost = np.array([[0.0, 0.9], [0.9, 5.0]])
    np.testing.assert_array_equal(assign(cost, cost < 1.0), [[0, 1], [1, 0]])


def test_only_allowed_pairs_are_made():
    cost = np.array([[0.0, 1.0], [2.0, 3.0]])
    assert assign(cost, np.zeros((2, 2), dtype=bool)).shape == (0, 2)
    np.testing.assert_array_equal(assign(cost, np.array([[False, False], [True, False]])), [[1, 0]])
    assert assign(np.zeros((0, 3)), np.zeros((0, 3), dtype=bool)).shape == (0, 2)


@given(
    st.integers(1, 4).flatmap(
        lambda n: st.lists(st.lists(st.floats(0.0, 10.0), min_size=4, max_size=4), min_size=n, max_size=n)
    ),
    st.floats(0.0, 10.0),
)
@settings(max_examples=150, deadline=None)
def test_agrees_with_trying_all_assignments(cost, limit):
    cost = np.array(cost)
    allowed = cost <= limit
    best = (0, 0.0)
    for columns in permutations(range(4), len(cost)):
        chosen = [cost[i, j] for i, j in enumerate(columns) if allowed[i, j]]
        best = min(best, (-len(chosen), sum(chosen)))
    pairs = assign(cost, allowed)
    assert allowed[pairs[:, 0], pairs[:, 1]].all()
    assert len({*pairs[:, 0].tolist()}) == len({*pairs[:, 1].tolist()}) == len(pairs) == -best[0]
    assert cost[pairs[:, 0], pairs[:, 1]].sum() == pytest.approx(best[1], abs=1e-9)


def test_reach_is_half_the_diagonal_or_more_by_tolerance_or_a_fixed_distance(case):
    objects = case.truth.objects
    unsized = tuple(replace(true, size=np.full(3, np.nan)) for true in objects[3:5])
    truth = replace(case.truth, objects=(*objects[:3], *unsized), tolerance={1: 0.01, 2: 5.0, 3: 0.08})
    halves = [np.linalg.norm(true.size) / 2.0 for true in objects[:2]]
    expected = [*halves, 5.0, 0.08, 0.15]
    np.testing.assert_allclose(reaches(replace(case, truth=truth)), expected)


def test_believed_is_existence_times_probability(case):
    things = list(case.things)
    things[0] = replace(things[0], probability=0.49)
    things[1] = replace(things[1], thing=replace(things[1].thing, existence=0.7), probability=0.72)
    assert len(believed(replace(case, things=tuple(things)))) == 7


def test_every_thing_finds_its_object_in_any_order(case):
    things = case.things[::-1]
    for matching in (
        match_by_distance(case, things, all_count(case)),
        match_by_volume(case, things, all_count(case), 0.5),
    ):
        assert [(thing.thing.id, true.id) for thing, true in matching.matched] == [
            (f"thing-{k:04d}", k) for k in range(7, -1, -1)
        ]
        assert not matching.false_positives and not matching.missed and not matching.duplicates


def test_just_inside_and_just_outside_the_reach(case):
    reach = reaches(case)[6]
    for shift, found in ((reach - 1e-9, 1), (reach + 1e-9, 0)):
        things = (moved(case.things[6], [0.0, 0.0, shift]),)
        assert len(match_by_distance(case, things, all_count(case)).matched) == found


def test_volumes_must_overlap_by_the_given_share(case):
    height = float(case.truth.objects[6].size[2])
    things = (moved(case.things[6], [0.0, 0.0, height / 3.0]),)  # two thirds shared: 1/2
    assert len(match_by_volume(case, things, all_count(case), 0.5 - 1e-9).matched) == 1
    assert len(match_by_volume(case, things, all_count(case), 0.5 + 1e-9).matched) == 0


def test_what_need_not_be_found_takes_its_thing_and_counts_for_nothing(case):
    counted = all_count(case)
    counted[3] = False
    with_it = match_by_distance(case, case.things, counted)
    without = match_by_distance(case, tuple(t for t in case.things if t.thing.id != "thing-0003"), counted)
    for matching in (with_it, without):
        assert len(matching.claims) == len(matching.wanted) == len(matching.matched) == 7
        assert not matching.false_positives and not matching.missed


def test_a_second_thing_is_a_duplicate_and_the_nearer_one_stays(case):
    second = replace(moved(case.things[0], [0.01, 0.0, 0.0]), thing=replace(case.things[0].thing, id="second"))
    matching = match_by_distance(case, (second, *case.things), all_count(case))
    assert [thing.thing.id for thing in matching.duplicates] == ["second"]
    assert [thing.thing.id for thing in matching.false_positives] == ["second"]
    far = replace(second, position=second.position + 5.0)
    matching = match_by_distance(case, (far, *case.things), all_count(case))
    assert not matching.duplicates and len(matching.false_positives) == 1


def test_a_second_thing_on_what_need_not_be_found_is_false_but_no_duplicate(case):
    counted = all_count(case)
    counted[0] = False
    second = replace(moved(case.things[0], [0.01, 0.0, 0.0]), thing=replace(case.things[0].thing, id="second"))
    matching = match_by_distance(case, (second, *case.things), counted)
    assert [thing.thing.id for thing in matching.false_positives] == ["second"]
    assert not matching.duplicates


def test_the_likelier_thing_chooses_first_even_if_it_is_farther(case):
    ghost = replace(case.things[0], thing=replace(case.things[0].thing, id="ghost", existence=0.2))
    sure = moved(case.things[0], [0.02, 0.0, 0.0])
    matching = match_ranked(replace(case, things=(ghost, sure)))
    assert [(thing.thing.id, true.id) for thing, true in matching.matched] == [("thing-0000", 0)]
    assert [thing.thing.id for thing in matching.false_positives] == ["ghost"]


def test_ranked_takes_each_object_once_and_needs_no_object(case):
    assert len(match_ranked(case).matched) == 8
    nothing = replace(case, truth=replace(case.truth, objects=()))
    assert len(match_ranked(nothing).false_positives) == 8
    assert not match_ranked(replace(case, things=())).matched


def test_objects_without_size_match_by_distance_only(case):
    objects = tuple(replace(true, size=np.full(3, np.nan)) for true in case.truth.objects)
    sizeless = replace(case, truth=replace(case.truth, objects=objects))
    assert len(match_by_distance(sizeless, case.things, all_count(case)).matched) == 8
    assert len(match_by_volume(sizeless, case.things, all_count(case), 0.25).matched) == 0


def test_a_truth_places_all_objects_only_if_it_is_complete_and_knows_where_they_are(scene_truth):
    lost = TrueObject(99, "cup", np.full(3, np.nan), np.full(3, np.nan), 0.0)
    assert places_all(scene_truth)
    assert not places_all(replace(scene_truth, complete=False))
    assert not places_all(replace(scene_truth, objects=(*scene_truth.objects, lost)))
    assert not places_all(replace(scene_truth, objects=()))
