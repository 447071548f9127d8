import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from thingmap.datasets.errors import UserError
from thingmap.mapper.queries.relation_support import ROOM_HEIGHT

RELATIONS = ("on", "supports_of", "inside", "under", "next_to")
TABLE = ([0.0, 0.0, 0.375], [1.2, 0.8, 0.75])
MUG = [0.08, 0.08, 0.1]


def found(answers):
    return {answer.thing.id: answer.probability for answer in answers}


@pytest.fixture
def kitchen(box, room):
    """A table; on it a mug, a book and a cup on the book; a mug beside it; a bag under it; an apple in a bowl."""
    return room(
        box(1, "table", *TABLE),
        box(2, "mug", [0.3, 0.1, 0.80], MUG),
        box(3, "book", [-0.2, 0.0, 0.765], [0.25, 0.2, 0.03]),
        box(4, "cup", [-0.2, 0.0, 0.83], MUG),
        box(5, "mug", [0.75, 0.0, 0.80], MUG),
        box(6, "bag", [0.0, 0.1, 0.15], [0.3, 0.2, 0.3]),
        box(7, "bowl", [0.3, -0.2, 0.79], [0.2, 0.2, 0.08]),
        box(8, "apple", [0.3, -0.2, 0.80], [0.07, 0.07, 0.06]),
    )


def test_on_means_resting_there_and_nothing_else(kitchen):
    on = found(kitchen.on("table"))
    assert set(on) == {"thing-0002", "thing-0003", "thing-0007"}
    assert min(on.values()) > 0.9
    assert set(found(kitchen.on("thing-0003"))) == {"thing-0004"}
    beside = found(kitchen.on("table", min_probability=0.0))
    assert beside.get("thing-0005", 0.0) < 1e-3  # at the table's height, but beside it
    assert beside.get("thing-0004", 0.0) < 0.1  # on the book that is on the table


def test_what_it_rests_on_is_the_reverse(kitchen):
    (support,) = kitchen.supports_of("thing-0004")
    assert support.thing.id == "thing-0003"
    assert support.probability == pytest.approx(found(kitchen.on("book"))["thing-0004"])
    assert kitchen.supports_of("thing-0005") == []


def test_in_under_and_beside(kitchen):
    assert set(found(kitchen.inside("bowl"))) == {"thing-0008"}
    assert kitchen.inside("table") == []  # it is hollow: what is in its box is under it
    assert set(found(kitchen.under("table"))) == {"thing-0006"}
    assert set(found(kitchen.under("book"))) == {"thing-0001"}
    assert "thing-0007" not in found(kitchen.next_to("apple"))


def test_next_to_is_level_and_near(box, room):
    shelf = room(
        box(1, "cup", [0.0, 0.0, 0.05], [0.1, 0.1, 0.1]),
        box(2, "cup", [0.15, 0.0, 0.05], [0.1, 0.1, 0.1]),
        box(3, "cup", [0.0, 0.15, 0.5], [0.1, 0.1, 0.1]),
        box(4, "cup", [0.9, 0.0, 0.05], [0.1, 0.1, 0.1]),
    )
    (answer,) = shelf.next_to("thing-0001")
    assert answer.thing.id == "thing-0002" and answer.probability > 0.99
    assert answer.distance == pytest.approx(0.05, abs=0.003) and answer.distance_std == pytest.approx(0.01, abs=0.003)
    assert {"thing-0002", "thing-0004"} == set(found(shelf.next_to("thing-0001", reach=1.0)))
    with pytest.raises(ValueError, match="reach"):
        shelf.next_to("thing-0001", reach=-1.0)


def test_a_label_stands_for_whatever_may_be_one(box, room):
    may_be = box(1, "table", *TABLE, probability=0.6, class_posterior={"table": 0.6, "chest": 0.4}, existence=0.9)
    object_map = room(may_be, box(2, "mug", [0.3, 0.1, 0.80], MUG, existence=0.8), box(3, "mug", [3.0, 0, 0.05], MUG))
    by_id = found(object_map.on("thing-0001", min_probability=0.0))["thing-0002"]
    assert by_id <= 0.9 * 0.8
    by_label = found(object_map.on("the tables", min_probability=0.0))["thing-0002"]
    assert by_label == pytest.approx(0.6 * by_id)
    assert object_map.on("thing-0001", "chest") == []
    assert found(object_map.on("thing-0001", "mugs"))["thing-0002"] == pytest.approx(by_id)


def test_what_is_not_there_is_said(kitchen, box, room):
    with pytest.raises(UserError, match="no label 'sofa' in this map"):
        kitchen.on("sofa")
    with pytest.raises(UserError, match="thing-0099"):
        kitchen.on("thing-0099")
    gone = dataclasses.replace(kitchen, things=kitchen.things[1:])
    with pytest.raises(UserError, match="no table in the map of room"):
        gone.under("table")
    with pytest.raises(UserError, match="no label 'sofa'"):
        kitchen.on("table", "sofa")


def test_a_chair_that_seems_to_stand_on_the_table_stands_on_the_floor(box, room):
    back = [0.4, 0.4, 0.2]
    object_map = room(
        box(1, "table", *TABLE), box(2, "chair", [-0.4, 0, 0.85], back), box(3, "vase", [0.4, 0, 0.85], back)
    )
    on = found(object_map.on("table", min_probability=0.0))
    assert on["thing-0003"] > 0.9 and on["thing-0002"] < 0.2


def test_a_small_gap_says_less_the_better_it_is_known(box, room):
    def on(gap, std):
        mug = box(2, "mug", [0.0, 0.0, 0.80 + gap], MUG, std=std)
        return found(room(box(1, "table", *TABLE, std=0.0), mug).on("table", min_probability=0.0)).get("thing-0002", 0)

    assert on(0.06, 0.03) > 0.8 > 0.2 > on(0.06, 0.003)
    assert on(0.0, 0.003) > on(0.02, 0.003) > on(0.04, 0.003)


def weight_by_sampling(a, b, contact_std=0.01, count=400_000):
    """w_b of `relation_support` by plain sampling, for boxes without yaw."""
    rng = np.random.default_rng(1)
    pa = rng.multivariate_normal(a.position, a.position_covariance, count)
    pb = rng.multivariate_normal(b.position, b.position_covariance, count)
    sb = np.maximum(b.size + b.size_std * rng.normal(size=(count, 3)), 0.0)
    sa = a.size[2] + a.size_std[2] * rng.normal(size=count)
    over = np.all(np.abs(pa - pb)[:, :2] <= sb[:, :2] / 2, axis=1)
    gap = (pa[:, 2] - sa / 2) - (pb[:, 2] + sb[:, 2] / 2) + contact_std * rng.normal(size=count)
    width = 0.002  # density of a gap of 0 by counting
    return np.mean(over & (np.abs(gap) < width)) / (2 * width)


@pytest.mark.parametrize("x", [0.0, 0.55, 0.62])
@pytest.mark.parametrize("gap", [0.0, 0.03])
def test_on_agrees_with_sampling(box, room, x, gap):
    A = np.array([[0.03, 0.0, 0.0], [0.01, 0.02, 0.0], [0.015, 0.0, 0.01]])
    table = box(1, "table", *TABLE, size_std=[0.05, 0.05, 0.01])
    mug = box(2, "mug", [x, 0.1, 0.80 + gap], MUG, position_covariance=A @ A.T)
    weight, turned = weight_by_sampling(mug, table), weight_by_sampling(table, mug, count=1000)
    expected = weight / (1 / ROOM_HEIGHT + weight + turned)
    assert found(room(table, mug).on("table", min_probability=0.0))["thing-0002"] == pytest.approx(expected, abs=0.03)


def corners_of(thing, offset, size):
    c, s = np.cos(thing.yaw), np.sin(thing.yaw)
    local = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size[:2] / 2
    return local @ np.array([[c, s], [-s, c]]) + offset[:2]


def events_by_sampling(a, b, count=3000):
    """P(inside), P(beside) of the definitions by plain sampling with the polygons of shapely."""
    from shapely import Point, Polygon

    rng = np.random.default_rng(2)
    inside = beside = 0
    for _ in range(count):
        pa, pb = (rng.multivariate_normal(t.position, t.position_covariance) for t in (a, b))
        sa, sb = (np.maximum(t.size + t.size_std * rng.normal(size=3), 1e-6) for t in (a, b))
        first, second = Polygon(corners_of(a, pa, sa)), Polygon(corners_of(b, pb, sb))
        low = max(pa[2] - sa[2] / 2, pb[2] - sb[2] / 2)
        level = max(min(pa[2] + sa[2] / 2, pb[2] + sb[2] / 2) - low, 0.0)
        share = first.intersection(second).area / first.area * level / sa[2]
        inside += share > 0.5 and sa.prod() < sb.prod()
        apart = not second.contains(Point(pa[:2])) and not first.contains(Point(pb[:2]))
        limit = np.sqrt(sa[:2].mean() * sb[:2].mean())
        beside += apart and level > 0.5 * min(sa[2], sb[2]) and first.distance(second) <= limit
    return inside / count, beside / count


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.12, 0.1, 0.05), (0.25, 0.05, 0.02), (0.33, 0.2, 0.0)])
def test_inside_and_beside_agree_with_sampling(box, room, offset):
    bowl = box(1, "bowl", [1.0, 2.0, 0.5], [0.3, 0.4, 0.3], std=0.02, yaw=0.5)
    apple = box(2, "apple", np.add([1.0, 2.0, 0.5], offset), [0.12, 0.08, 0.1], std=0.02, yaw=-0.4)
    object_map = room(bowl, apple)
    inside, beside = events_by_sampling(apple, bowl)
    assert found(object_map.inside("bowl", min_probability=0)).get("thing-0002", 0) == pytest.approx(inside, abs=0.05)
    assert found(object_map.next_to("bowl", min_probability=0)).get("thing-0002", 0) == pytest.approx(beside, abs=0.05)


def test_probabilities_of_resting_are_calibrated(box, room):
    """Mugs that rest on a table or hang beside and above it, measured with the errors that the map claims: of those
    given a probability p about a share p rests there."""
    rng = np.random.default_rng(7)
    claimed, true = [], []
    for _ in range(150):
        things, rests = [box(1, "table", *TABLE, std=0.0)], []
        for number in range(2, 6):
            rests.append(rng.random() < 0.5)
            height = 0.80 if rests[-1] else rng.uniform(-0.4, 2.1)
            std = rng.uniform(0.005, 0.06)
            place = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-0.3, 0.3), height])
            measured = place + std * rng.normal(size=3)
            things.append(box(number, "mug", measured, MUG, size_std=[0.0] * 3, position_covariance=std**2 * np.eye(3)))
        on = found(room(*things).on("table", min_probability=0.0))
        claimed += [on.get(thing.id, 0.0) for thing in things[1:]]
        true += rests
    p, y = np.array(claimed), np.array(true, dtype=float)
    assert np.mean((p - y) ** 2) < 0.05  # 0.25 for somebody who does not know
    assert np.mean(p) == pytest.approx(np.mean(y), abs=0.04)
    sure = p > 0.9
    assert y[sure].mean() > 0.9 and sure.sum() > 200


NUMBER = st.floats(-0.4, 0.4)
SIZE = st.tuples(*[st.floats(0.03, 0.5)] * 3).map(list)
PLACED = st.lists(
    st.tuples(st.tuples(NUMBER, NUMBER, NUMBER).map(list), SIZE, st.floats(-3, 3)), min_size=2, max_size=5
)


@given(PLACED, st.floats(0.002, 0.1))
@settings(max_examples=40, deadline=None)
def test_probabilities_are_probabilities_and_nothing_is_with_itself(box, room, placed, std):
    things = [box(k, "table" if k == 0 else "mug", p, s, std, yaw=y) for k, (p, s, y) in enumerate(placed)]
    object_map = room(*things, std=0.02)
    for thing in things:
        for relation in RELATIONS:
            answers = getattr(object_map, relation)(thing, min_probability=0.0)
            assert all(0.0 < answer.probability <= 1.0 for answer in answers)
            assert thing.id not in found(answers)
            ranked = [answer.probability for answer in answers]
            assert ranked == sorted(ranked, reverse=True)
        carried = sum(found(object_map.supports_of(thing, min_probability=0.0)).values())
        assert carried <= 1.0 + 1e-9
    a, b = things[:2]
    one = found(object_map.on(a, min_probability=0.0)).get(b.id, 0.0)
    other = found(object_map.on(b, min_probability=0.0)).get(a.id, 0.0)
    assert one + other <= 1.0 + 1e-9
    beside = found(object_map.next_to(a, min_probability=0.0)).get(b.id, 0.0)
    assert beside == pytest.approx(found(object_map.next_to(b, min_probability=0.0)).get(a.id, 0.0), abs=0.07)


@given(PLACED, st.floats(-3, 3), st.tuples(NUMBER, NUMBER, NUMBER), st.integers(0, 2**31))
@settings(max_examples=25, deadline=None)
def test_turning_and_moving_the_room_changes_nothing(box, room, placed, angle, shift, seed):
    """The whole map is turned about any axis: boxes keep their place in the upright frame up to a yaw."""
    things = [box(k, "table" if k == 0 else "mug", p, s, 0.02, yaw=y) for k, (p, s, y) in enumerate(placed)]
    R = Rotation.random(random_state=seed).as_matrix()
    before = room(*things)
    after_empty = room(up=R[:, 2])
    U = after_empty.R_world_upright
    turn = U.T @ R  # about up only: from the old upright frame, the map's own, to the new one
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    moved = [
        dataclasses.replace(
            thing,
            position=R @ thing.position + shift,
            position_covariance=R @ thing.position_covariance @ R.T,
            yaw=thing.yaw + yaw,
        )
        for thing in things
    ]
    after = room(*moved, up=R[:, 2])
    for relation in RELATIONS:
        one = found(getattr(before, relation)(things[0].id, min_probability=0.0))
        other = found(getattr(after, relation)(things[0].id, min_probability=0.0))
        for key in one.keys() | other.keys():
            assert one.get(key, 0.0) == pytest.approx(other.get(key, 0.0), abs=0.01)


def test_an_empty_map_and_equal_answers_twice(room, kitchen):
    with pytest.raises(UserError):
        room().on("thing-0001")
    assert kitchen.on("table") == kitchen.on("table")
