"""The index gives what going through all things gives."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thingmap.mapper.map.polygon import Polygon
from thingmap.mapper.map.region import Ball, Box, probability_inside
from thingmap.mapper.queries.index import ThingIndex
from thingmap.mapper.queries.inside_bounds import inside_bounds

LABELS = ("cup", "Cup", "bowl", "book")
coordinates = st.floats(-2.0, 2.0) | st.sampled_from([-1.0, 0.0, 0.5, 1.0])  # equal ones among them
stds = st.sampled_from([0.0, 1e-3, 0.02, 0.3])
probabilities = st.floats(0.0, 1.0) | st.sampled_from([0.0, 0.5, 1.0])


@st.composite
def covariances(draw) -> np.ndarray:
    """Some degenerate, some turned."""
    angle, (a, b, c) = draw(st.floats(0.0, 3.0)), draw(st.tuples(stds, stds, stds))
    cosine, sine = np.cos(angle), np.sin(angle)
    R = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    covariance = R @ np.diag([a * a, b * b, c * c]) @ R.T
    return (covariance + covariance.T) / 2.0


@st.composite
def scenes(draw, make_thing):
    things = []
    for number in range(draw(st.integers(0, 12))):
        weights = draw(st.dictionaries(st.sampled_from(LABELS), st.floats(0.0, 1.0), min_size=1))
        total = sum(weights.values()) or 1.0
        posterior = {name: weight / total for name, weight in weights.items()}
        label = max(posterior, key=posterior.__getitem__)
        things.append(
            make_thing(
                number,
                label,
                posterior[label],
                class_posterior=posterior,
                existence=draw(probabilities),
                position=draw(st.tuples(coordinates, coordinates, coordinates)),
                position_covariance=draw(covariances()),
            )
        )
    return things


@st.composite
def regions(draw) -> Box | Ball:
    point = st.tuples(coordinates, coordinates, coordinates)
    if draw(st.booleans()):
        return Ball(np.array(draw(point)), draw(st.floats(0.0, 2.0)))
    corners = np.array([draw(point), draw(point)])
    return Box(corners.min(axis=0), corners.max(axis=0))


def asked_for(things, label, least):
    """Things with the probability that is asked for; several labels: that it is any of them."""
    wanted = [label] if isinstance(label, str) else label and tuple(dict.fromkeys(one.casefold() for one in label))
    known = [(t, t.existence if wanted is None else min(sum(map(t.belief, wanted)), t.existence)) for t in things]
    return [(thing, p) for thing, p in known if p >= least and p > 0.0]


labels = st.sampled_from([None, "cup", "BOWL", "lamp", ("cup", "book", "CUP"), ()])


@given(data=st.data(), label=labels, least=probabilities, count=st.none() | st.integers(0, 14))
@settings(max_examples=150, deadline=None)
def test_the_nearest_are_among_those_that_the_index_names(make_thing, data, label, least, count):
    things = data.draw(scenes(make_thing))
    origin = np.array(data.draw(st.tuples(coordinates, coordinates, coordinates)))
    everything = asked_for(things, label, least)
    ranked = sorted(everything, key=lambda one: (np.linalg.norm(one[0].position - origin), one[0].id))
    found = ThingIndex(things).near(origin, label, count, least)
    assert {thing.id: p for thing, p in found}.items() >= {t.id: p for t, p in ranked[:count]}.items()
    assert len({thing.id for thing, _ in found}) == len(found)
    if found and count:  # and none that is farther
        last = np.linalg.norm(ranked[: max(count, 1)][-1][0].position - origin)
        assert all(np.linalg.norm(thing.position - origin) <= last * (1.0 + 1e-8) + 1e-11 for thing, _ in found)


@given(data=st.data(), label=labels, least=probabilities, region=regions())
@settings(max_examples=150, deadline=None)
def test_things_within_a_region(make_thing, data, label, least, region):
    things = data.draw(scenes(make_thing))
    found = {thing.id: p for thing, p in ThingIndex(things).within(region, label, least)}
    for thing, p in asked_for(things, label, least):
        exact = p * probability_inside(region, thing.position, thing.position_covariance)
        if abs(exact - least) > 0.004 and exact > 1e-9:  # integrals are within 0.002
            assert (thing.id in found) == (exact >= least)
        if thing.id in found:
            assert found[thing.id] == pytest.approx(exact, abs=0.004) and found[thing.id] >= least
    assert set(found) <= {thing.id for thing, _ in asked_for(things, label, least)}


@given(
    data=st.data(),
    least=probabilities,
    place=st.tuples(coordinates, coordinates),
    size=st.floats(0.1, 3.0),
    heights=st.sampled_from([(-np.inf, np.inf), (-0.5, 0.7)]),
    turn=st.sampled_from([0.0, 0.4, 2.0]),
)
@settings(max_examples=100, deadline=None)
def test_nothing_over_a_polygon_is_left_out(make_thing, data, least, place, size, heights, turn):
    things = data.draw(scenes(make_thing))
    polygon = Polygon(np.array([[0.0, 0.0], [size, 0.0], [0.0, size]]) + place, *heights)
    R = Rotation.from_rotvec([turn, 0.3 * turn, 0.0]).as_matrix()
    found = {thing.id: p for thing, p in ThingIndex(things).over(polygon, R, None, least)}
    for thing, p in asked_for(things, None, least):
        inside = probability_inside(polygon, R.T @ thing.position, R.T @ thing.position_covariance @ R)
        if p * inside >= least + 0.004:
            assert found[thing.id] == p
    assert found.items() <= {thing.id: p for thing, p in asked_for(things, None, least)}.items()


@given(data=st.data(), least=probabilities)
@settings(max_examples=100, deadline=None)
def test_labels_are_ranked(make_thing, data, least):
    things = data.draw(scenes(make_thing))
    wanted = data.draw(st.lists(st.sampled_from(["cup", "bowl", "lamp"]), max_size=3, unique=True))
    ranked = sorted(asked_for(things, wanted, least), key=lambda one: (-one[1], one[0].id))
    index = ThingIndex(things)
    for _ in range(2):  # made, and kept
        assert [(a.thing, a.probability) for a in index.ranked(wanted, least)] == ranked


@given(region=regions(), mean=st.tuples(coordinates, coordinates, coordinates), covariance=covariances())
@settings(max_examples=200, deadline=None)
def test_bounds_hold(region, mean, covariance):
    lower, upper = inside_bounds(region, np.array([mean]), covariance[None])
    assert 0.0 <= lower[0] <= upper[0] + 1e-12 <= 1.0 + 2e-12
    exact = probability_inside(region, np.array(mean), covariance)
    on_the_edge = np.linalg.eigvalsh(covariance)[0] < 1e-12  # then rounding says which side of a face it is
    assert on_the_edge or lower[0] - 0.003 <= exact <= upper[0] + 0.003


def test_bounds_by_sampling():
    """A point of which all about the region is known by drawing it."""
    rng = np.random.default_rng(3)
    covariance = np.array([[0.04, 0.02, 0.0], [0.02, 0.09, 0.01], [0.0, 0.01, 0.01]])
    x = rng.multivariate_normal([0.2, 0.1, 0.0], covariance, size=200_000)
    box, ball = Box(np.array([-0.5, -0.3, -2.0]), np.array([0.3, 2.0, 2.0])), Ball(np.zeros(3), 0.6)
    inside = np.all((x >= box.low) & (x <= box.high), axis=1).mean(), (np.linalg.norm(x, axis=1) <= 0.6).mean()
    for region, share in zip((box, ball), inside, strict=True):
        lower, upper = inside_bounds(region, np.array([[0.2, 0.1, 0.0]]), covariance[None])
        assert lower[0] - 0.005 <= share <= upper[0] + 0.005


def test_equally_far_things_are_all_named(make_thing):
    things = [make_thing(k, position=[np.cos(k), np.sin(k), 0.0]) for k in range(20)]
    assert len(ThingIndex(things).near(np.zeros(3), None, 3, 0.5)) == 20


def test_ids_and_names(make_thing):
    index = ThingIndex([make_thing(1, name="My  mug"), make_thing(2)])
    assert index.thing("thing-0002").id == "thing-0002" and index.thing("thing-0003") is None
    assert [thing.id for thing in index.named(" my MUG ")] == ["thing-0001"]
    assert index.named("mug") == () and index.names() == ("My  mug",)


def test_a_map_makes_its_index_once_and_a_changed_map_another(make_map, make_thing):
    from dataclasses import replace

    object_map = make_map(make_thing(1), make_thing(2))
    assert object_map.index is object_map.index
    fewer = replace(object_map, things=object_map.things[:1])
    assert fewer.index is not object_map.index and fewer.index.thing("thing-0002") is None


def test_groups_that_were_not_asked_for_long_are_forgotten(make_thing):
    index = ThingIndex([make_thing(k) for k in range(5)])
    for k in range(300):
        assert len(index.near(np.zeros(3), "cup", None, 0.001 * (k + 1))) == 5
    assert len(index._groups) <= 32
