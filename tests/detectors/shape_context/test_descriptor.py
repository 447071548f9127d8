import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.detectors.shape_context.config import ANGLES, LENGTH, ORIENTATIONS, RINGS
from thingmap.detectors.shape_context.descriptor import shape_contexts
from thingmap.detectors.shape_context.edge_map import EdgeMap

SIZE = 201
MIDDLE = 100


def edge_map(x, y, orientation: float | np.ndarray = 0.0, shape=(SIZE, SIZE)):
    """An edge map of points in any order, and where each went."""
    x, y = np.atleast_1d(x).astype(np.int32), np.atleast_1d(y).astype(np.int32)
    orientation = np.broadcast_to(np.asarray(orientation, dtype=np.float32), x.shape)
    order = np.lexsort([x, y])
    start = np.searchsorted(y[order], np.arange(shape[0] + 1)).astype(np.int64)
    filled = np.ones(len(x), dtype=np.float32)
    edges = EdgeMap(shape, x[order], y[order], start, orientation[order], filled, filled > 0)
    return edges, np.argsort(order)


def around(offsets, radius, orientation: float | np.ndarray = 0.0):
    """(ORIENTATIONS, ANGLES, RINGS), the descriptor of the point in the middle with neighbours at offsets (N, 2)."""
    offsets = np.concatenate([[[0, 0]], np.reshape(offsets, (-1, 2))])
    orientation = np.concatenate([[0.0], np.broadcast_to(orientation, len(offsets) - 1)])
    edges, places = edge_map(MIDDLE + offsets[:, 0], MIDDLE + offsets[:, 1], orientation)
    row = shape_contexts(edges, places[:1], np.array([radius], dtype=np.float32))
    assert row.shape == (1, LENGTH) and row.dtype == np.float32
    return row.reshape(ORIENTATIONS, ANGLES, RINGS)


def polar(angle, distance):
    return np.round(np.stack([distance * np.cos(angle), distance * np.sin(angle)], axis=-1)).astype(int)


def brute_force(edges, points, radius, owner):
    """The definition, a point at a time."""
    result = np.zeros((len(points), ORIENTATIONS, ANGLES, RINGS))
    x, y = edges.columns.astype(float), edges.rows.astype(float)
    orientation = np.round(edges.orientation / (np.pi / ORIENTATIONS)).astype(int) % ORIENTATIONS
    for row, point, r in zip(result, points, radius.astype(float), strict=True):
        dx, dy = x - x[point], y - y[point]
        distance = np.sqrt(dx**2 + dy**2)
        near = (distance <= r) & (np.arange(len(x)) != point) & (owner == owner[point])
        angle = np.floor(np.degrees(np.arctan2(dy, dx)) / 30.0 + 0.5 + 1e-6).astype(int) % ANGLES
        ring = np.where(distance <= r / 4, 0, np.where(distance <= r / 2, 1, 2))
        np.add.at(row, (orientation[near], angle[near], ring[near]), 1.0 / max(near.sum(), 1))
    return result.reshape(len(points), LENGTH)


def test_one_neighbour_in_each_bin():
    for o in range(ORIENTATIONS):
        for a in range(ANGLES):
            for ring, distance in enumerate((20, 40, 80)):
                found = around(polar(a * np.pi / 6, distance), 90.0, o * np.pi / 4)
                assert found[o, a, ring] == 1.0 and found.sum() == 1.0


@pytest.mark.parametrize(
    ("offset", "ring"),
    [((10, 0), 0), ((11, 0), 1), ((20, 0), 1), ((21, 0), 2), ((40, 0), 2), ((24, 32), 2), ((-6, -8), 0), ((12, 16), 1)],
)
def test_limits_of_rings_belong_to_the_inner_one(offset, ring):
    assert around(offset, 40.0)[..., ring].sum() == 1.0


@pytest.mark.parametrize("offset", [(41, 0), (0, -41), (25, 32), (24, -33)])
def test_beyond_the_radius_nothing_counts(offset):
    assert not around(offset, 40.0).any()


def test_directions_go_from_x_towards_y():
    found = around([(50, 0), (0, 50), (-50, 0), (0, -50)], 60.0)
    assert np.flatnonzero(found[0, :, 2]).tolist() == [0, 3, 6, 9]


@pytest.mark.parametrize(
    ("degrees", "orientation"), [(0, 0), (22, 0), (23, 1), (45, 1), (67, 1), (68, 2), (90, 2), (135, 3), (158, 0)]
)
def test_orientations_are_centred_and_go_around(degrees, orientation):
    assert around((30, 0), 40.0, np.radians(degrees))[orientation].sum() == 1.0


def test_turning_the_points_by_30_degrees_shifts_the_angles():
    rng = np.random.default_rng(0)
    angle = rng.integers(0, ANGLES, 60) * np.pi / 6 + np.radians(rng.uniform(-11, 11, 60))
    distance, orientation = rng.choice([18.0, 38.0, 75.0], 60), rng.integers(0, 4, 60) * np.pi / 4
    before = around(polar(angle, distance), 90.0, orientation)
    after = around(polar(angle + np.pi / 6, distance), 90.0, orientation)
    assert (before > 0).sum() > 20
    np.testing.assert_array_equal(after, np.roll(before, 1, axis=1))


def test_turning_the_image_by_90_degrees_shifts_orientations_too():
    rng = np.random.default_rng(1)
    offsets, orientation = rng.integers(-60, 60, (50, 2)), rng.uniform(0, np.pi / 2, 50)
    offsets = np.unique(offsets[offsets.any(axis=1)], axis=0)
    orientation = orientation[: len(offsets)]
    turned = np.stack([-offsets[:, 1], offsets[:, 0]], axis=1)
    before, after = around(offsets, 50.0, orientation), around(turned, 50.0, orientation + np.pi / 2)
    np.testing.assert_array_equal(after, np.roll(before, (2, 3), axis=(0, 1)))


def test_twice_the_coordinates_and_radius_give_the_same():
    rng = np.random.default_rng(2)
    pixels = rng.choice(100 * 100, 400, replace=False)
    orientation, points = rng.uniform(0, np.pi, 400), rng.choice(400, 50, replace=False)
    radius = rng.uniform(5, 40, 50).astype(np.float32)
    small, places = edge_map(pixels % 100, pixels // 100, orientation)
    large, others = edge_map(2 * (pixels % 100), 2 * (pixels // 100), orientation)
    first = shape_contexts(small, places[points], radius)
    np.testing.assert_array_equal(first, shape_contexts(large, others[points], 2 * radius))
    assert first.any(axis=1).sum() > 40


def test_only_points_of_the_same_owner_count():
    edges, places = edge_map([50, 60, 50, 45], [50, 50, 60, 50])
    owner = np.zeros(4, dtype=np.int32)
    owner[places] = [3, 3, 7, -1]
    first, alone = shape_contexts(edges, places[[0, 3]], np.full(2, 20.0, np.float32), owner)
    assert first[0 * RINGS + 1] == 1.0 and first.sum() == 1.0
    assert not alone.any()


def test_every_point_has_its_own_radius():
    edges, places = edge_map([50, 60, 80], [50, 50, 50])
    near, none, far = shape_contexts(edges, places[[0, 0, 0]], np.array([10.0, 9.5, 1000.0], np.float32))
    assert near[2] == 1.0 and not none.any()
    assert far[0] == 1.0  # both neighbours are within a quarter of the radius, in the same direction


def test_no_points_give_no_rows():
    edges, _ = edge_map([50], [50])
    assert shape_contexts(edges, np.zeros(0, int), np.zeros(0, np.float32)).shape == (0, LENGTH)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 300), st.sampled_from([(40, 60), (7, 90), (120, 30)]), st.booleans())
def test_as_the_definition_says(seed, count, shape, owned):
    rng = np.random.default_rng(seed)
    pixels = rng.choice(shape[0] * shape[1], min(count, shape[0] * shape[1]), replace=False)
    edges, _ = edge_map(pixels % shape[1], pixels // shape[1], rng.uniform(0, 3.1415, len(pixels)), shape)
    owner = rng.integers(-1, 2, len(edges)).astype(np.int32) if owned else np.zeros(len(edges), np.int32)
    points = rng.integers(0, len(edges), 20)
    radius = rng.choice([rng.uniform(0.5, 150, 20), rng.integers(1, 50, 20)]).astype(np.float32)
    found = shape_contexts(edges, points, radius, owner if owned else None)
    expected = brute_force(edges, points, radius, owner)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    np.testing.assert_allclose(found.sum(axis=1), expected.any(axis=1), atol=1e-5)
    np.testing.assert_array_equal(found, shape_contexts(edges, points, radius, owner if owned else None))


@pytest.mark.parametrize(
    ("points", "radius", "owner", "said"),
    [
        ([0], [5.0, 6.0], None, "must be"),
        ([1], [5.0], None, "from 0 to 0"),
        ([-1], [5.0], None, "from 0 to 0"),
        ([0], [0.0], None, "positive"),
        ([0], [np.inf], None, "positive"),
        ([0], [5.0], np.zeros(3, np.int32), "owner"),
    ],
)
def test_wrong_arguments_are_told(points, radius, owner, said):
    edges, _ = edge_map([50], [50])
    with pytest.raises(ValueError, match=said):
        shape_contexts(edges, np.array(points), np.array(radius), owner)


def test_what_is_turned_a_quarter_is_described_as_if_turned_back():
    rng = np.random.default_rng(3)
    offsets = rng.integers(-40, 41, (60, 2))
    offsets = offsets[(offsets != 0).any(axis=1)]
    orientation = rng.uniform(0.05, 0.7, len(offsets))  # within one bin
    turned = np.stack([-offsets[:, 1], offsets[:, 0]], axis=1)
    upright = around(offsets, 50.0, orientation)
    every = np.concatenate([[[0, 0]], turned])
    edges, places = edge_map(
        MIDDLE + every[:, 0], MIDDLE + every[:, 1], np.concatenate([[0.0], orientation + np.pi / 2])
    )
    radius, turn = np.array([50.0], dtype=np.float32), np.array([np.pi / 2])
    back = shape_contexts(edges, places[:1], radius, turn=turn).reshape(upright.shape)
    # directions on a limit between two bins may fall to either side
    assert np.abs(back - upright).sum() < 0.1
    plain = shape_contexts(edges, places[:1], radius).reshape(upright.shape)
    assert np.abs(plain - upright).sum() > 0.8
