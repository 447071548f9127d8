"""Which points are described."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.detectors.shape_context.edge_map import EdgeMap
from thingmap.detectors.shape_context.sampling import edge_owners, sample_points


def test_an_edge_between_two_things_belongs_to_the_one_at_its_depth(edge_map):
    labels = np.full((60, 80), -1, dtype=np.int32)
    labels[10:30, 10:20], labels[10:30, 20:40] = 0, 1
    depth = np.where(labels == 0, 1.0, 2.0).astype(np.float32)
    on_far_pixel = edge_map([(20, 15)], depth=1.0)
    assert edge_owners(on_far_pixel, labels, depth).tolist() == [0]
    assert edge_owners(edge_map([(19, 15)], depth=2.0), labels, depth).tolist() == [1]


def test_an_edge_just_outside_a_mask_is_its_and_a_far_one_nobodys(edge_map):
    labels = np.full((60, 80), -1, dtype=np.int32)
    labels[10:30, 10:20] = 4
    edges = edge_map([(21, 15), (23, 15), (0, 0)])
    owner = edge_owners(edges, labels, np.ones((60, 80), np.float32))
    assert owner[edges.columns == 21] == 4 and (owner[edges.columns != 21] == -1).all()


def line(count: int, owner: np.ndarray) -> tuple[EdgeMap, np.ndarray]:
    columns = np.arange(count, dtype=np.int32)
    nothing = np.zeros(count, dtype=np.float32)
    start = np.array([0, count], dtype=np.int64)
    edges = EdgeMap((1, count), columns, 0 * columns, start, nothing, nothing + 1.0, np.ones(count, dtype=bool))
    return edges, owner.astype(np.int32)


@given(
    counts=st.lists(st.integers(0, 60), min_size=1, max_size=6),
    most=st.integers(0, 120),
    most_each=st.integers(0, 40),
    seed=st.integers(0, 99),
)
def test_samples_stand_for_all_points_of_their_thing(counts, most, most_each, seed):
    owner = np.repeat(np.arange(len(counts)), counts)
    owner = np.random.default_rng(seed).permutation(owner)
    edges, owner = line(len(owner), owner)
    samples = sample_points(edges, owner, most, most_each)
    assert len(samples.points) <= most
    assert (np.diff(samples.points) > 0).all() and (samples.owner == owner[samples.points]).all()
    taken = np.bincount(samples.owner, minlength=len(counts))
    assert (taken <= most_each).all()
    for number, count in enumerate(counts):
        if taken[number]:
            assert samples.weight[samples.owner == number].sum() == pytest.approx(count)
        # nobody goes short while another has more than a fair share
        assert taken[number] in (count, taken.max())


def test_samples_are_spread_along_the_contour():
    edges, owner = line(100, np.zeros(100))
    points = sample_points(edges, owner, 1000, 10).points
    assert len(points) == 10 and set(np.diff(points)) == {10}


def test_points_without_depth_or_owner_are_not_described(edge_map):
    edges = edge_map([(1, 1), (2, 1), (3, 1)], depth=np.array([1.0, 0.0, 1.0]))
    samples = sample_points(edges, np.array([0, 0, -1], dtype=np.int32), 10, 10)
    assert samples.points.tolist() == [0] and samples.weight.tolist() == [1.0]
    nobody = sample_points(edges, np.full(3, -1, dtype=np.int32), 10, 10)
    assert len(nobody.points) == len(nobody.owner) == len(nobody.weight) == 0
