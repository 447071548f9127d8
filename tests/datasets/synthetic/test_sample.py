"""The table-top sequence as a whole, rendered small."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.datasets.errors import UserError
from thingmap.datasets.open import open_sequence
from thingmap.datasets.sequence import Sequence
from thingmap.datasets.synthetic.mesh import rotation_z
from thingmap.datasets.synthetic.rendering.sensor import IDEAL
from thingmap.datasets.synthetic.rooms.room import ROOM, TABLE_HEIGHT, TABLE_TOP
from thingmap.datasets.synthetic.sample import TabletopConfig, TabletopSequence, open_sample
from thingmap.datasets.synthetic.things.objects import Model
from thingmap.datasets.synthetic.world import GAP, arrange, build_world, footprint, overlap
from thingmap.datasets.truth import HasTruth

SMALL = TabletopConfig(width=160, frames=120)
SOME_FRAMES = range(0, 120, 17)


@pytest.fixture(scope="module")
def tabletop() -> TabletopSequence:
    return TabletopSequence(SMALL)


def world_points(sequence: TabletopSequence, index: int) -> np.ndarray:
    """(H * W, 3) true surface points, world."""
    depth = sequence.true_depth(index).ravel().astype(float)
    v, u = np.divmod(np.arange(depth.size), sequence.intrinsics.width)
    camera = sequence.intrinsics.back_project(np.stack([u, v], axis=1), depth)
    T = sequence.poses[index]
    return camera @ T[:3, :3].T + T[:3, 3]


def test_it_is_a_sequence_with_truth(tabletop):
    assert isinstance(tabletop, Sequence) and isinstance(tabletop, HasTruth)
    assert len(tabletop) == 120 and tabletop.poses.shape == (120, 4, 4) and tabletop.gravity is None
    assert len(tabletop.objects) == 12 and {thing.label for thing in tabletop.objects} == set(tabletop.classes)
    assert not {thing.label for thing in tabletop.clutter} & set(tabletop.classes)
    frame = tabletop[7]
    assert frame.color.shape == (120, 160, 3) and frame.color.dtype == np.uint8
    assert frame.depth.shape == (120, 160) and frame.depth.dtype == np.float32
    assert (frame.index, frame.name, frame.stamp) == (7, tabletop.names[7], tabletop.stamps[7])
    np.testing.assert_array_equal(frame.T_world_camera, tabletop.poses[7])
    assert [frame.index for frame in open_sample("tabletop?width=64&frames=3")] == [0, 1, 2]
    assert len(set(tabletop.names)) == 120
    with pytest.raises(IndexError):
        tabletop[120]


def test_frames_depend_on_the_configuration_and_the_index_only(tabletop):
    other = pickle.loads(pickle.dumps(tabletop))
    forward = [tabletop[k] for k in (3, 60, 119)]
    for frame in (other[119], other[3], other[-60]):
        same = next(f for f in forward if f.index == frame.index)
        np.testing.assert_array_equal(frame.color, same.color)
        np.testing.assert_array_equal(frame.depth, same.depth)
    longer = TabletopSequence(replace(SMALL, frames=200))[3]
    np.testing.assert_array_equal(longer.color, forward[0].color)
    reseeded = TabletopSequence(replace(SMALL, seed=1))[3]
    assert np.abs(reseeded.color.astype(int) - forward[0].color).mean() > 10


def test_a_world_is_built_alike_every_time():
    first, second = (build_world.__wrapped__(5, 3) for _ in range(2))
    for name in first.surfaces._fields:
        np.testing.assert_array_equal(getattr(first.surfaces, name), getattr(second.surfaces, name), err_msg=name)
    assert [thing.yaw for thing in first.objects] == [thing.yaw for thing in second.objects]


def test_every_ray_ends_in_the_room_and_the_table_is_where_it_should_be(tabletop):
    for index in SOME_FRAMES:
        points = world_points(tabletop, index)
        assert np.isfinite(points).all() and tabletop.true_depth(index).min() > 0.3
        low, high = np.array([-ROOM[0] / 2, -ROOM[1] / 2, 0.0]), np.array([ROOM[0] / 2, ROOM[1] / 2, ROOM[2]])
        assert np.all(points > low - 1e-4) and np.all(points < high + 1e-4)
        over_table = np.all(np.abs(points[:, :2]) < np.array(TABLE_TOP[:2]) / 2 - 0.01, axis=1)
        room = tabletop.instances(index).ravel() == -1
        on_top = over_table & room & (points[:, 2] > 0.71)
        assert on_top.mean() > 0.1
        np.testing.assert_allclose(points[on_top, 2], TABLE_HEIGHT, atol=2e-6)


def test_things_stand_on_the_table_and_do_not_touch(tabletop):
    things = (*tabletop.objects, *tabletop.clutter)
    boxes = [footprint(*thing.position[:2], thing.yaw, thing.size) for thing in things]
    for k, thing in enumerate(things):
        assert thing.position[2] - thing.size[2] / 2 == pytest.approx(TABLE_HEIGHT)
        assert np.all(np.abs(boxes[k]) < np.array(TABLE_TOP[:2]) / 2)
        assert not any(overlap(boxes[k], other) for other in boxes[:k])


def test_pixels_of_a_thing_lie_in_its_box(tabletop):
    things = {thing.id: thing for thing in (*tabletop.objects, *tabletop.clutter)}
    found = set()
    for index in SOME_FRAMES:
        points, owner = world_points(tabletop, index), tabletop.instances(index).ravel()
        for number in np.unique(owner[owner >= 0]):
            thing = things[int(number)]
            local = (points[owner == number] - thing.position) @ rotation_z(thing.yaw)
            assert np.all(np.abs(local) <= thing.size / 2 + 1e-4)
            found.add(thing.id)
    assert len(found) == len(things), "everything is seen at some time"


def test_truth_agrees_with_the_instance_masks(tabletop):
    partly = 0
    for index in SOME_FRAMES:
        truth, owner = tabletop.truth(index), tabletop.instances(index)
        assert set(np.unique(owner[(owner >= 0) & (owner < 12)])) <= set(truth.object_id)
        for k, number in enumerate(truth.object_id):
            rows, columns = np.nonzero(owner == number)
            assert 0.0 <= truth.visibility[k] <= 1.0
            if not len(rows):
                assert truth.visibility[k] == 0.0 and np.isnan(truth.xyxy_visible[k]).all()
                continue
            mask_box = [columns.min() - 0.5, rows.min() - 0.5, columns.max() + 0.5, rows.max() + 0.5]
            np.testing.assert_array_equal(truth.xyxy_visible[k], mask_box)
            assert np.all(truth.xyxy[k][:2] <= mask_box[:2] + np.array(0.5)) and np.all(
                truth.xyxy[k][2:] >= mask_box[2:] - np.array(0.5)
            )
            if truth.visibility[k] == 1.0:
                assert np.abs(truth.xyxy[k] - mask_box).max() <= 3.0  # thin parts fall between pixels of 160 x 120
            partly += 0.1 < truth.visibility[k] < 0.8
    assert partly >= 8, "some things occlude others"


def test_without_the_sensors_effects_depth_is_exact():
    ideal = TabletopSequence(replace(SMALL, sensor=IDEAL, frames=40))
    np.testing.assert_array_equal(ideal[30].depth, ideal.true_depth(30))
    real = TabletopSequence(replace(SMALL, frames=40))[30].depth
    valid = real > 0
    assert 0.6 < valid.mean() < 0.99
    error = np.abs(real - ideal[30].depth)[valid] / ideal[30].depth[valid] ** 2
    assert 5e-4 < np.median(error) < 3e-3


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    sizes=st.lists(st.tuples(st.floats(0.04, 0.2), st.floats(0.04, 0.2)), min_size=2, max_size=12),
)
def test_arrangements_leave_the_gap(seed, sizes):
    models = [Model("thing", (), np.array([x, y, 0.1])) for x, y in sizes]
    spots = arrange(models, np.random.default_rng(seed))
    for k, spot in enumerate(spots):
        for j in range(k):
            grown = footprint(*spots[j], models[j].size + 0.99 * GAP)
            assert not overlap(footprint(*spot, models[k].size + 0.99 * GAP), grown)


@settings(max_examples=50, deadline=None)
@given(
    x=st.floats(-0.5, 0.5), y=st.floats(-0.5, 0.5), yaw=st.floats(-4.0, 4.0), seed=st.integers(0, 1000)
)  # fmt: skip
def test_overlap_is_symmetric_and_finds_shared_points(x, y, yaw, seed):
    a = footprint(0.0, 0.0, 0.3, np.array([0.4, 0.2, 0.1]))
    b = footprint(x, y, yaw, np.array([0.1, 0.5, 0.1]))
    weights = np.random.default_rng(seed).dirichlet(np.ones(4), 300)
    inside_b = weights @ b
    local = inside_b @ rotation_z(0.3)[:2, :2]
    shared = np.any(np.all(np.abs(local) < np.array([0.2, 0.1]) - 1e-9, axis=1))
    assert overlap(a, b) == overlap(b, a)
    assert overlap(a, b) or not shared


def test_a_table_too_small_is_said_so():
    models = [Model("plate", (), np.array([0.5, 0.5, 0.1]))] * 6
    with pytest.raises(UserError, match="fewer objects"):
        arrange(models, np.random.default_rng(0))


def test_open_sample_reads_its_parameters():
    sequence = open_sample("tabletop?seed=3&objects=5&frames=7&width=64")
    assert (len(sequence), len(sequence.objects), sequence.intrinsics.width) == (7, 5, 64)
    assert sequence.config.seed == 3 and sequence.name == "sample:tabletop?seed=3&objects=5&frames=7&width=64"
    assert open_sample(sequence.name).config == sequence.config
    assert len(open_sequence("sample:tabletop?width=64&frames=10", stride=4)) == 3


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("kitchen", "expected one of tabletop, found 'kitchen'"),
        ("", "expected one of tabletop"),
        ("tabletop?speed=2", "expected parameters seed, objects, frames, width, found 'speed'"),
        ("tabletop?objects=many", "expected a whole number for objects, found 'many'"),
        ("tabletop?objects=", "expected a whole number for objects"),
        ("tabletop?objects=0", "expected objects from 1 to"),
        ("tabletop?objects=900", "expected objects from 1 to"),
        ("tabletop?width=70", "divisible by 4"),
    ],
)
def test_mistakes_are_named(name, said):
    with pytest.raises(UserError, match=said):
        open_sample(name)
