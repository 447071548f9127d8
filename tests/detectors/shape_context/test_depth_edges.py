"""Edges of depth: jumps count; slants, noise and holes do not."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.detectors.proposals.config import DEPTH_SIGMA
from thingmap.detectors.shape_context.depth_edges import depth_edges, inverse_depth

SHAPE = (120, 160)
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]]
FOCAL = 525.0


def flat(metres: float = 1.5) -> np.ndarray:
    return np.full(SHAPE, metres, np.float32)


def noisy(depth: np.ndarray, seed: int = 0) -> np.ndarray:
    """As a structured-light camera reads it: inverse depth with noise, in steps of disparity."""
    rng = np.random.default_rng(seed)
    inverse = 1.0 / depth + rng.normal(0, DEPTH_SIGMA, depth.shape)
    step = 0.125 / (FOCAL * 0.075)
    return (1.0 / (np.round(inverse / step) * step)).astype(np.float32)


def tilted(degrees: float = 60.0, metres: float = 1.0) -> np.ndarray:
    """A table seen from above: a plane whose normal is so far from the line of sight."""
    normal = np.array([0.0, np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])
    rays = np.stack([(X - 80) / FOCAL, (Y - 60) / FOCAL, np.ones(SHAPE)], axis=-1)
    return (metres * normal[2] / (rays @ normal)).astype(np.float32)


@pytest.mark.parametrize("near", [0.6, 1.4, 2.4])
def test_a_step_is_one_line_beside_it(near: float) -> None:
    depth = flat(near)
    depth[:, 90:] = 3.0
    is_edge, orientation = depth_edges(depth)
    assert (is_edge.sum(axis=1) == 1).all()
    assert np.abs(np.nonzero(is_edge)[1] - 89.5).max() <= 1.0
    assert np.abs(np.sin(orientation[is_edge])).max() < np.sin(np.radians(1))


def test_the_least_step_grows_with_the_square_of_distance() -> None:
    def is_seen(near: float, step: float) -> bool:
        depth = flat(near)
        depth[:, 80:] += step
        return bool(depth_edges(depth)[0].any())

    assert is_seen(1.0, 0.025) and not is_seen(1.0, 0.005)
    assert is_seen(3.0, 0.2) and not is_seen(3.0, 0.025)


@pytest.mark.parametrize("metres", [0.7, 1.5, 3.0])
def test_noise_and_steps_of_disparity_are_no_edges(metres: float) -> None:
    assert not depth_edges(noisy(flat(metres)))[0].any()


@pytest.mark.parametrize("degrees", [30.0, 60.0, 75.0])
def test_a_slanted_plane_has_no_edges(degrees: float) -> None:
    assert not depth_edges(tilted(degrees))[0].any()
    assert depth_edges(noisy(tilted(degrees)))[0].sum() < 0.002 * X.size


def test_a_thing_on_a_slanted_plane_keeps_its_rim() -> None:
    depth = tilted(60.0)
    disc = (X - 80) ** 2 + (Y - 60) ** 2 < 30**2
    depth[disc] -= 0.08
    is_edge, orientation = depth_edges(noisy(depth))
    distance = np.hypot(X - 80, Y - 60)[is_edge]
    assert is_edge.sum() > 0.85 * 2 * np.pi * 30 * 0.8  # a digital circle has fewer points than its length
    assert np.abs(distance - 30).max() < 3
    off = orientation[is_edge] - np.arctan2(Y - 60, X - 80)[is_edge]
    off = np.degrees((off + np.pi / 2) % np.pi - np.pi / 2)
    assert np.median(np.abs(off)) < 5.0


@pytest.mark.parametrize("make", [flat, tilted])
def test_a_hole_in_one_surface_is_no_edge(make) -> None:
    depth = noisy(make())
    depth[30:70, 40:100] = 0.0
    assert not depth_edges(depth)[0][25:75, 35:105].any()


def test_a_hole_beside_a_thing_leaves_one_edge_at_the_thing() -> None:
    depth = flat(2.0)
    depth[30:90, 60:100] = 1.0
    depth[30:90, 100:118] = 0.0  # the projector's shadow
    is_edge, _ = depth_edges(depth)
    columns = np.nonzero(is_edge[45:75, 85:140])[1] + 85
    assert len(columns) == 30 and np.abs(columns - 99.5).max() <= 1.0


def test_no_edge_is_made_up_far_from_all_readings() -> None:
    depth = flat(1.0)
    depth[:70] = 0.0  # a far wall above things of various distance
    depth[70:, 50:100] = 0.7
    is_edge, _ = depth_edges(depth)
    assert is_edge[75:].any() and not is_edge[:66].any()


def test_holes_are_filled_by_what_lies_behind_and_readings_stay() -> None:
    depth = flat(2.0)
    depth[:, 60:100] = 1.0
    holed = depth.copy()
    holed[:, 100:110] = np.nan
    holed[40:45, 20:25] = np.inf
    inverse = inverse_depth(holed)
    np.testing.assert_allclose(inverse, 1.0 / depth, rtol=1e-6)
    assert inverse.dtype == np.float32


def test_readings_of_one_corner_fill_everything() -> None:
    depth = np.zeros(SHAPE, np.float32)
    depth[:5, :5] = 2.0
    np.testing.assert_allclose(inverse_depth(depth), 0.5)
    assert not depth_edges(depth)[0].any()


def test_without_readings_there_is_nothing() -> None:
    for nothing in (0.0, np.nan, -1.0):
        is_edge, _ = depth_edges(np.full(SHAPE, nothing, np.float32))
        assert not is_edge.any()
        assert (inverse_depth(np.full(SHAPE, nothing, np.float32)) == 0).all()
