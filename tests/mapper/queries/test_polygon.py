import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon as Shape
from shapely import contains_xy

from thingmap.mapper.map.polygon import Polygon
from thingmap.mapper.map.region import Box, as_region, probability_inside

DENTED = np.array([[0, 0], [2, 0], [2, 2], [1, 0.5], [0, 2]], dtype=float)
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)


@pytest.mark.parametrize("corners", [DENTED, DENTED[::-1], np.roll(DENTED, 2, axis=0)])
@pytest.mark.parametrize("heights", [(-np.inf, np.inf), (0.3, 0.8)])
@pytest.mark.parametrize("seed", range(3))
def test_agrees_with_sampling(corners, heights, seed):
    rng = np.random.default_rng(seed)
    A = 0.4 * rng.normal(size=(3, 3))
    mean, covariance = rng.uniform([0, 0, 0.2], [2, 2, 0.9]), A @ A.T
    samples = rng.multivariate_normal(mean, covariance, 200_000)
    inside = contains_xy(Shape(corners), samples[:, 0], samples[:, 1])
    inside &= (samples[:, 2] >= heights[0]) & (samples[:, 2] <= heights[1])
    region = as_region((corners, heights)) if np.isfinite(heights[0]) else as_region(corners)
    assert probability_inside(region, mean, covariance) == pytest.approx(inside.mean(), abs=0.005)


@given(st.tuples(*[st.floats(-0.5, 1.5)] * 3).map(np.array), st.tuples(*[st.floats(1e-3, 0.7)] * 3).map(np.array))
@settings(max_examples=40, deadline=None)
def test_a_square_is_a_box(mean, std):
    box = probability_inside(Box(np.zeros(3), np.ones(3)), mean, np.diag(std**2))
    assert probability_inside(Polygon(SQUARE, 0.0, 1.0), mean, np.diag(std**2)) == pytest.approx(box, abs=0.004)


def test_a_point_without_uncertainty_is_in_or_out():
    nothing = np.zeros((3, 3))
    for point, inside in (([0.5, 0.5, 0.5], 1.0), ([1.0, 0.6, 0.5], 0.0), ([1.9, 1.5, 0.5], 1.0), ([1, 0.2, 1.5], 0.0)):
        assert probability_inside(Polygon(DENTED, 0.0, 1.0), np.array(point), nothing) == inside


@pytest.mark.parametrize(
    ("corners", "heights", "part"),
    [
        ([[0, 0], [1, 1]], (0, 1), "at least 3"),
        ([[0, 0], [1, 1], [2, 2]], (0, 1), "an area"),
        ([[0, 0], [1, 1], [1, 0], [0, 1.5]], (0, 1), "going round"),
        (SQUARE, (1, 0), "low <= high"),
        ([[0, 0], [1, np.nan], [1, 0]], (0, 1), "finite"),
    ],
)
def test_what_is_no_polygon_is_refused(corners, heights, part):
    with pytest.raises(ValueError, match=part):
        Polygon(np.array(corners), *heights)


def test_within_a_polygon_is_measured_in_the_upright_frame(make_thing, make_map):
    inside = make_thing(1, position=[0.5, -0.4, 0.5], position_covariance=1e-6 * np.eye(3), existence=1.0)
    object_map = make_map(inside)  # up is -y: upright x is x, upright y is z, the height is -y
    upright = object_map.R_world_upright.T @ inside.position
    corners = SQUARE - 0.5 + upright[:2]
    (answer,) = object_map.within(corners)
    assert answer.probability == pytest.approx(1.0, abs=1e-3)
    assert object_map.within((corners, (0.3, 0.5)))[0].thing.id == "thing-0001"
    assert object_map.within((corners, (0.5, 0.7))) == []
    assert object_map.within(corners + 1.0) == []
    assert object_map.within(corners, "bowl", min_probability=0.05)[0].probability == pytest.approx(0.1, abs=1e-3)
