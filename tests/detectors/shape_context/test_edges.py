"""Depth and colour in one map of edges."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.datasets.synthetic.synth import open_synth
from thingmap.detectors.shape_context.edge_config import EdgeConfig
from thingmap.detectors.shape_context.edge_map import EdgeMap
from thingmap.detectors.shape_context.edges import find_edges

SHAPE = (120, 160)
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]]


def gray(level: int = 120) -> np.ndarray:
    return np.full((*SHAPE, 3), level, np.uint8)


def flat(metres: float = 1.5) -> np.ndarray:
    return np.full(SHAPE, metres, np.float32)


def square_of_color() -> np.ndarray:
    color = gray()
    color[40:80, 50:110] = (200, 60, 60)
    return color


def same(a: EdgeMap, b: EdgeMap) -> bool:
    names = ("columns", "rows", "row_start", "orientation", "depth", "is_depth")
    return a.shape == b.shape and all(np.array_equal(getattr(a, n), getattr(b, n)) for n in names)


def assert_consistent(edges: EdgeMap, shape: tuple[int, int]) -> None:
    place = edges.rows.astype(np.int64) * max(shape[1], 1) + edges.columns
    assert edges.shape == shape
    assert (np.diff(place) > 0).all()
    assert ((edges.rows >= 0) & (edges.rows < shape[0])).all()
    assert ((edges.columns >= 0) & (edges.columns < shape[1])).all()
    assert edges.row_start.shape == (shape[0] + 1,) and edges.row_start[-1] == len(edges)
    np.testing.assert_array_equal(edges.row_start, np.searchsorted(edges.rows, np.arange(shape[0] + 1)))
    assert ((edges.orientation >= 0) & (edges.orientation < np.pi)).all()
    assert (np.isfinite(edges.depth) & (edges.depth >= 0)).all()
    kinds = {"columns": np.int32, "rows": np.int32, "row_start": np.int64, "is_depth": bool}
    for name in ("columns", "rows", "row_start", "orientation", "depth", "is_depth"):
        assert getattr(edges, name).dtype == kinds.get(name, np.float32), name


def test_a_square_of_colour_on_a_flat_surface_has_a_rim_of_colour() -> None:
    edges = find_edges(square_of_color(), flat(1.5))
    assert_consistent(edges, SHAPE)
    assert not edges.is_depth.any()
    assert len(edges) > 0.85 * 2 * (40 + 60)
    off = np.maximum(np.abs(edges.columns - 79.5) - 30, np.abs(edges.rows - 59.5) - 20)
    assert np.abs(off).max() <= 3
    np.testing.assert_allclose(edges.depth, 1.5, rtol=1e-5)


def test_a_step_of_depth_alone_belongs_to_the_nearer_side() -> None:
    depth = flat(2.0)
    depth[:, :70] = 1.2
    edges = find_edges(gray(), depth)
    assert len(edges) == SHAPE[0] and edges.is_depth.all()
    assert np.abs(edges.columns - 69.5).max() <= 1
    np.testing.assert_allclose(edges.depth, 1.2, rtol=1e-5)


def test_a_step_of_both_is_one_line() -> None:
    color, depth = gray(), flat(2.0)
    color[:, :70] = 30
    depth[:, :71] = 1.2  # a pixel off, as registered images are
    edges = find_edges(color, depth)
    assert len(edges) == SHAPE[0] and edges.is_depth.all()


def test_orientation_on_a_disc_points_to_its_middle() -> None:
    disc = (X - 80) ** 2 + (Y - 60) ** 2 < 35**2
    nearer, redder = flat(2.0), gray()
    nearer[disc] = 1.0
    redder[disc] = (220, 70, 70)
    for edges in (find_edges(gray(), nearer), find_edges(redder, flat())):
        away = np.arctan2(edges.rows - 60, edges.columns - 80)
        off = np.degrees((edges.orientation - away + np.pi / 2) % np.pi - np.pi / 2)
        assert len(edges) > 150
        assert np.abs(np.hypot(edges.rows - 60, edges.columns - 80) - 35).max() < 2.5
        assert np.median(np.abs(off)) < 3.0 and np.abs(off).max() < 15.0


def test_depth_is_zero_where_nothing_near_was_measured() -> None:
    depth = flat(1.5)
    depth[:, 75:] = 0.0
    edges = find_edges(square_of_color(), depth)
    assert not edges.is_depth.any()
    assert (edges.depth[edges.columns > 80] == 0).all() and (edges.depth[edges.columns < 74] > 0).all()


def test_colour_alone_does_without_depth() -> None:
    edges = find_edges(square_of_color(), np.zeros(SHAPE, np.float32))
    assert_consistent(edges, SHAPE)
    assert len(edges) > 150 and (edges.depth == 0).all()


def test_within_keeps_what_is_asked_for_and_its_rim() -> None:
    depth = flat(2.0)
    depth[20:50, 20:60] = 1.0
    within = np.zeros(SHAPE, bool)
    within[40:80, 50:110] = True
    full, part = find_edges(square_of_color(), depth), find_edges(square_of_color(), depth, within=within)
    assert_consistent(part, SHAPE)
    inside = (full.columns >= 48) & (full.columns < 112) & (full.rows >= 38) & (full.rows < 82)
    expected = full.select(inside)
    assert 0 < len(part) < len(full)
    np.testing.assert_array_equal(part.columns, expected.columns)
    np.testing.assert_array_equal(part.rows, expected.rows)
    np.testing.assert_array_equal(part.is_depth, expected.is_depth)
    np.testing.assert_allclose(part.orientation, expected.orientation, atol=1e-3)
    assert same(find_edges(square_of_color(), depth, within=np.ones(SHAPE, bool)), full)


@pytest.mark.parametrize("shape", [(0, 0), (0, 7), (1, 1), (1, 9), (2, 3), (5, 1), (7, 11)])
def test_tiny_images(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    color = rng.integers(0, 255, (*shape, 3)).astype(np.uint8)
    assert_consistent(find_edges(color, rng.random(shape).astype(np.float32)), shape)


def test_an_even_image_and_nothing_asked_for_have_no_points() -> None:
    assert len(find_edges(gray(), flat())) == 0
    edges = find_edges(square_of_color(), flat(), within=np.zeros(SHAPE, bool))
    assert len(edges) == 0
    assert_consistent(edges, SHAPE)


def test_images_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="uint8"):
        find_edges(gray().astype(np.float32), flat())
    with pytest.raises(ValueError, match="depth"):
        find_edges(gray(), flat()[:-1])
    with pytest.raises(ValueError, match="within"):
        find_edges(gray(), flat(), within=np.ones(SHAPE, np.uint8))


blocks = st.tuples(
    *(st.integers(0, 40) for _ in range(4)), st.integers(0, 255), st.sampled_from([0.0, 0.6, 1.0, 3.0, np.nan])
)


@settings(max_examples=40, deadline=None)
@given(
    st.tuples(st.integers(1, 50), st.integers(1, 50)),
    st.lists(blocks, max_size=5),
    st.integers(0, 30),
    st.booleans(),
    st.integers(0, 2**16),
)
def test_points_are_sorted_and_in_range(shape, things, noise, is_part, seed) -> None:
    rng = np.random.default_rng(seed)
    color, depth = np.full((*shape, 3), 100.0), np.full(shape, 1.5, np.float32)
    for top, left, height, width, level, metres in things:
        color[top : top + height, left : left + width] = level, 255 - level, 80
        depth[top : top + height, left : left + width] = metres
    color = np.clip(color + rng.normal(0, noise, color.shape), 0, 255).astype(np.uint8)
    within = rng.random(shape) < 0.05 if is_part else None
    edges = find_edges(color, depth, within=within)
    assert_consistent(edges, shape)
    assert same(edges, find_edges(color, depth, EdgeConfig(), within))


def test_outlines_of_rendered_things_are_found() -> None:
    sequence = open_synth("tabletop?clutter=low&seed=1")
    frame, instances = sequence[10], sequence.instances(10)
    edges = find_edges(frame.color, frame.depth)
    border = np.zeros(instances.shape, bool)
    border[:, 1:] |= instances[:, 1:] != instances[:, :-1]
    border[1:] |= instances[1:] != instances[:-1]
    close = np.zeros(instances.shape, bool)
    for dy in range(-3, 4):
        for dx in range(-3, 4):
            close[np.clip(edges.rows + dy, 0, 479), np.clip(edges.columns + dx, 0, 639)] = True
    assert close[border].mean() > 0.9
    assert len(edges) < 0.08 * instances.size
