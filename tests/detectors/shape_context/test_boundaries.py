"""Boundaries of colour: half-discs against each other."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.detectors.shape_context.boundaries import color_boundaries, half_discs, linked, thinned
from thingmap.detectors.shape_context.edge_config import BoundaryConfig

SHAPE = (120, 160)


def step(column: int = 80, left: int = 90, right: int = 170) -> np.ndarray:
    image = np.full((*SHAPE, 3), left, np.uint8)
    image[:, column:] = right
    return image


@pytest.mark.parametrize("column", [80, 81, 50])
def test_a_step_is_one_line_beside_it(column: int) -> None:
    is_edge, orientation = color_boundaries(step(column))
    assert (is_edge.sum(axis=1) == 1).all()
    columns = np.nonzero(is_edge)[1]
    assert np.abs(columns - (column - 0.5)).max() <= 1.5
    assert np.abs(np.sin(orientation[is_edge])).max() < np.sin(np.radians(2))


def test_a_step_of_colour_alone_is_a_boundary() -> None:
    image = step(left=0, right=0)
    image[:, :80], image[:, 80:] = (150, 60, 60), (60, 98, 150)  # alike in lightness
    is_edge, _ = color_boundaries(image)
    assert (is_edge.sum(axis=1) == 1).all()


@pytest.mark.parametrize("angle", [10.0, 37.0, 61.0, 90.0, 128.0, 165.0])
def test_the_orientation_is_that_of_the_gradient(angle: float) -> None:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    side = (x - 80) * np.cos(np.radians(angle)) + (y - 60) * np.sin(np.radians(angle))
    image = np.repeat(np.clip(120 + 60 * side, 60, 180)[..., None], 3, axis=2).astype(np.uint8)
    is_edge, orientation = color_boundaries(image)
    inner = is_edge[15:-15, 15:-15]
    off = np.degrees(orientation[15:-15, 15:-15][inner]) - angle
    off = (off + 90.0) % 180.0 - 90.0
    assert inner.sum() > 40
    assert np.abs(off).max() < 6.0 and abs(off.mean()) < 2.0
    assert np.abs(side[15:-15, 15:-15][inner]).max() < 2.0


def test_what_an_even_or_noisy_surface_shows_is_no_boundary() -> None:
    rng = np.random.default_rng(0)
    noise = np.clip(128 + rng.normal(0, 10, (*SHAPE, 3)), 0, 255).astype(np.uint8)
    assert not color_boundaries(np.full((*SHAPE, 3), 77, np.uint8))[0].any()
    assert not color_boundaries(noise)[0].any()


def test_a_slow_change_of_light_is_no_boundary() -> None:
    image = np.repeat(np.linspace(60, 200, SHAPE[1])[None], SHAPE[0], axis=0)
    assert not color_boundaries(np.repeat(image[..., None], 3, axis=2).astype(np.uint8))[0].any()


def test_stripes_count_less_at_several_radii() -> None:
    """Stripes 6 pixels wide are alike on both sides of a line for half-discs that see more than one."""
    image = step(left=110, right=110)
    image[(np.arange(SHAPE[0]) // 6) % 2 == 0] = 150
    one = BoundaryConfig(radii=(4,))
    assert color_boundaries(image, one)[0].sum() > 1000
    assert color_boundaries(image)[0].sum() < 0.2 * color_boundaries(image, one)[0].sum()


def test_halves_of_a_disc_mirror_each_other() -> None:
    for radius in (1, 2, 5):
        runs = half_discs(radius)
        width = runs[..., 1] - runs[..., 0]
        other = runs[..., 3] - runs[..., 2]
        assert (width == other[:, ::-1]).all()
        assert (width.sum(axis=1) > 0).all()
        assert np.abs(runs).max() <= radius + 1


def test_the_contrast_is_the_difference_of_the_means() -> None:
    """In CIE Lab: 112 is 4.8 lighter than 100."""
    image = step(left=100, right=112)
    weak = BoundaryConfig(radii=(4,), low=1.0, high=4.5)
    strong = BoundaryConfig(radii=(4,), low=1.0, high=5.2)
    assert color_boundaries(image, weak)[0].any() and not color_boundaries(image, strong)[0].any()


def test_thin_points_are_the_largest_across() -> None:
    across = np.tile(np.array([0.0, 1, 3, 2, 1, 0, 0, 0], np.float32), (6, 1))
    is_thin = thinned(across, np.zeros_like(across), 0.5)
    assert is_thin[1:-1, 2].all() and is_thin[1:-1].sum() == 4


def test_linking_keeps_what_is_strong_somewhere_and_long() -> None:
    strength = np.zeros((9, 20), np.float32)
    strength[1, 1:9] = 2.0
    strength[1, 5] = 9.0  # weak points that a strong one holds
    strength[4, 1:9] = 2.0  # weak ones alone
    strength[7, 1:4] = 9.0  # strong, but short
    kept = linked(strength, 1.5, 5.0, 6)
    assert kept[1, 1:9].all() and kept.sum() == 8


@pytest.mark.parametrize("radii", [(), (3, 8), (8, 4), (4, 4), (0, 2)])
def test_radii_have_to_be_even_and_grow(radii: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="radii"):
        BoundaryConfig(radii=radii)
