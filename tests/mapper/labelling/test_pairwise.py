import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.mapper.labelling.mrf_config import MrfConfig, Smoothness
from thingmap.mapper.labelling.pairwise import colour_weights, normal_weights, pair_weights

UP = np.array([0.0, 0.0, 1.0])
PAIR = np.array([[0, 1]], np.int32)
LAMBDA, EPSILON = 100.0, 1.0 / 49.0


def test_defaults_are_the_papers() -> None:
    config = MrfConfig()
    assert (config.normals_strength, config.concave_share) == (100.0, 1.0 / 49.0)
    assert config.smoothness is Smoothness.NORMALS


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
    voxels, normals, colours = np.array([[0, 0, 1], [1, 0, 0]]), np.stack([UP, UP]), rng.random((2, 3))
    points = np.array([[0.5, 0.5, 1.9], [1.5, 0.5, 0.1]])

    def weights(config: MrfConfig) -> list[float]:
        return pair_weights(PAIR, voxels, points, normals, colours, config).tolist()

    numbers = LAMBDA / 4.0, EPSILON, MrfConfig().normals_offset
    paper = normal_weights(PAIR, voxels, points, normals, *numbers).tolist()
    assert weights(MrfConfig(looks=4.0, normals_step=np.inf, concave_from=0.0)) == paper
    ours = normal_weights(PAIR, voxels, points, normals, *numbers, 1.5, 0.1).tolist()
    assert weights(MrfConfig(looks=4.0, normals_step=1.5, concave_from=0.1)) == ours != paper
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
        {"normals_step": 0.0},
        {"normals_step": np.nan},
        {"concave_from": -0.1},
        {"concave_from": np.inf},
        {"contrast": np.nan},
        {"max_sweeps": 0},
        {"bound_sweeps": -1},
    ],
)
def test_numbers_out_of_range_are_a_users_mistake(change: dict) -> None:
    with pytest.raises(UserError, match=next(iter(change)).split("_")[-1]):
        MrfConfig(**change)
