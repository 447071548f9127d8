import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.mapper.labelling.mrf_config import MrfConfig, Smoothness
from thingmap.mapper.labelling.pairwise import colour_weights, normal_weights, pair_weights

UP, OUT, SLANTED = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
PAIR = np.array([[0, 1]], np.int32)
LAMBDA, EPSILON, OFFSET = 100.0, 1.0 / 49.0, 0.5


def weight(voxels: list, normals: list) -> float:
    weights = normal_weights(PAIR, np.array(voxels, np.int32), np.array(normals), LAMBDA, EPSILON, OFFSET)
    assert weights.dtype == np.float32 and weights.shape == (1,)
    return float(weights[0])


def test_defaults_are_the_papers() -> None:
    config = MrfConfig()
    assert (config.normals_strength, config.concave_share) == (100.0, 1.0 / 49.0)
    assert config.smoothness is Smoothness.NORMALS


def test_equal_normals_are_not_convex_and_nothing_apart() -> None:
    assert weight([[0, 0, 0], [1, 0, 0]], [UP, UP]) == pytest.approx(LAMBDA * EPSILON / OFFSET)


def test_the_edge_of_a_box_is_convex() -> None:
    top, side = [0, 0, 0], [1, 0, -1]  # over the edge and down the side that looks along x
    expected = LAMBDA * (1.0 + EPSILON) / (np.sqrt(2.0) + OFFSET)
    assert weight([top, side], [UP, OUT]) == pytest.approx(expected)
    assert weight([side, top], [OUT, UP]) == pytest.approx(expected)


def test_where_a_box_stands_on_a_table_is_concave() -> None:
    table, side = [1, 0, 0], [0, 0, 1]  # the side looks along x, over the table before it
    assert weight([table, side], [UP, OUT]) == pytest.approx(LAMBDA * EPSILON / (np.sqrt(2.0) + OFFSET))


def test_a_convex_border_costs_one_and_forty_nine_times_more_than_a_concave_one() -> None:
    convex = weight([[0, 0, 0], [1, 0, -1]], [UP, OUT])
    concave = weight([[1, 0, 0], [0, 0, 1]], [UP, OUT])
    assert convex / concave == pytest.approx(50.0)


def test_the_more_normals_differ_the_less_it_costs() -> None:
    flat = weight([[1, 0, 0], [0, 0, 0]], [UP, UP])
    bent = weight([[1, 0, 0], [0, 0, 1]], [UP, SLANTED])
    upright = weight([[1, 0, 0], [0, 0, 1]], [UP, OUT])
    assert flat > bent > upright


@pytest.mark.parametrize("unknown", [np.zeros(3), np.full(3, np.nan)])
def test_a_voxel_without_normal_has_its_neighbours(unknown: np.ndarray) -> None:
    assert weight([[0, 0, 0], [1, 0, -1]], [UP, unknown]) == pytest.approx(LAMBDA * EPSILON / OFFSET)
    assert weight([[0, 0, 0], [1, 0, -1]], [unknown, unknown]) == pytest.approx(LAMBDA * EPSILON / OFFSET)


def test_the_size_of_voxels_does_not_matter() -> None:
    rng = np.random.default_rng(0)
    voxels, normals = rng.integers(0, 2, (50, 3)), rng.normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    edges = np.array([[i, i + 1] for i in range(49)], np.int32)
    in_cells = normal_weights(edges, voxels.astype(np.int32), normals, LAMBDA, EPSILON, OFFSET)
    in_metres = normal_weights(edges, 0.01 * voxels, normals, LAMBDA, EPSILON, OFFSET)
    assert in_metres == pytest.approx(in_cells)


def test_normal_weights_against_the_equation_in_numpy() -> None:
    rng = np.random.default_rng(1)
    voxels, normals = rng.integers(-2, 3, (200, 3)).astype(np.int32), rng.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    edges = np.sort(rng.permutation(200).reshape(100, 2), axis=1).astype(np.int32)
    turn = normals[edges[:, 0]] - normals[edges[:, 1]]
    convex = (turn * (voxels[edges[:, 0]] - voxels[edges[:, 1]])).sum(axis=1) > 0.0
    expected = LAMBDA * (convex + EPSILON) / (np.linalg.norm(turn, axis=1) + OFFSET)
    assert 0 < convex.sum() < 100
    assert normal_weights(edges, voxels, normals, LAMBDA, EPSILON, OFFSET) == pytest.approx(expected, rel=1e-5)


def test_colours_far_apart_cost_less() -> None:
    colours = np.array([[0.0, 0.0, 0.0], [0.0, 0.3, 0.4], [0.0, 0.3, 0.4]])
    edges = np.array([[0, 1], [1, 2]], np.int32)
    weights = colour_weights(edges, colours, 3.0, contrast=4.0)
    assert weights.dtype == np.float32
    assert weights == pytest.approx([3.0 * np.exp(-4.0 * 0.25), 3.0])


def test_contrast_follows_the_mean_difference_so_that_units_do_not_matter() -> None:
    rng = np.random.default_rng(2)
    colours, edges = rng.random((30, 3)), np.array([[i, i + 1] for i in range(29)], np.int32)
    weights = colour_weights(edges, colours, 2.0)
    assert colour_weights(edges, 255.0 * colours, 2.0) == pytest.approx(weights, rel=1e-4)
    mean = (np.diff(colours, axis=0) ** 2).sum(axis=1).mean()
    assert weights == pytest.approx(colour_weights(edges, colours, 2.0, contrast=0.5 / mean), rel=1e-5)


def test_one_colour_or_none_is_potts() -> None:
    edges = np.array([[0, 1], [0, 2]], np.int32)
    assert colour_weights(edges, np.ones((3, 3)), 2.0).tolist() == [2.0, 2.0]
    assert colour_weights(edges, np.full((3, 3), np.nan), 2.0).tolist() == [2.0, 2.0]
    assert colour_weights(edges[:0], np.ones((3, 3)), 2.0).shape == (0,)


def test_the_configuration_names_the_term() -> None:
    rng = np.random.default_rng(3)
    voxels, normals, colours = np.array([[0, 0, 0], [1, 0, -1]]), np.stack([UP, OUT]), rng.random((2, 3))

    def weights(config: MrfConfig) -> list[float]:
        return pair_weights(PAIR, voxels, normals, colours, config).tolist()

    normal = normal_weights(PAIR, voxels, normals, LAMBDA / 4.0, EPSILON, MrfConfig().normals_offset).tolist()
    assert weights(MrfConfig(looks=4.0)) == normal
    colour = MrfConfig(smoothness=Smoothness.COLOUR, colour_strength=5.0, contrast=0.7, looks=1.0)
    assert weights(colour) == colour_weights(PAIR, colours, 5.0, 0.7).tolist()
    assert weights(MrfConfig(smoothness=Smoothness.POTTS, potts_strength=3.0, looks=2.0)) == [1.5]
    assert weights(MrfConfig(smoothness=Smoothness.NONE)) == [0.0]


@pytest.mark.parametrize(
    "change",
    [
        {"normals_strength": -1.0},
        {"normals_offset": 0.0},
        {"looks": 0.0},
        {"normals_agreement": 1.0},
        {"normals_radius": -1.0},
        {"contrast": np.nan},
        {"max_sweeps": 0},
        {"bound_sweeps": -1},
    ],
)
def test_numbers_out_of_range_are_a_users_mistake(change: dict) -> None:
    with pytest.raises(UserError, match=next(iter(change)).split("_")[-1]):
        MrfConfig(**change)
