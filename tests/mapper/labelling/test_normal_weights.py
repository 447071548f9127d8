"""What pairs cost by their normals: by hand, against the paper's equation, and our two exceptions from it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.mapper.labelling.pairwise import normal_weights

UP, OUT, SLANTED = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
PAIR = np.array([[0, 1]], np.int32)
LAMBDA, EPSILON, OFFSET = 100.0, 1.0 / 49.0, 0.5
STEP, FROM = 0.8, 0.3


def weight(voxels: list, normals: list, points: list | None = None, step: float = np.inf, begin: float = 0.0) -> float:
    """Of one pair; by the paper's equation unless `step` or `begin`, where concave pairs do, are given."""
    cells, means = np.array(voxels, np.int32), np.array(voxels if points is None else points, np.float64)
    weights = normal_weights(PAIR, cells, means, np.array(normals), LAMBDA, EPSILON, OFFSET, step, begin)
    assert weights.dtype == np.float32 and weights.shape == (1,)
    return float(weights[0])


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


def on_an_arc(degrees: list[float], radius: float = 5.0) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals out of a circle in the plane of x and z."""
    angle = np.radians(degrees)
    normals = np.column_stack([np.sin(angle), np.zeros(len(angle)), np.cos(angle)])
    return radius * normals, normals


def weight_on_an_arc(degrees: list[float], sign: float, **ours: float) -> float:
    points, normals = on_an_arc(degrees)
    return weight(np.floor(points).tolist(), list(sign * normals), points.tolist(), **ours)


def test_a_plane_costs_what_it_did() -> None:
    points = [[0.5, 0.5, 0.1], [1.4, 0.5, 0.8]]  # 0.7 apart along the normal: noise, and a voxel on a slanted plane
    flat = weight([[0, 0, 0], [1, 0, 0]], [UP, UP], points, STEP, FROM)
    assert flat == pytest.approx(LAMBDA * EPSILON / OFFSET)


def test_sheets_one_above_the_other_are_not_one_surface() -> None:
    cells, points = [[0, 0, 1], [1, 0, 0]], [[0.5, 0.5, 1.4], [1.5, 0.5, 0.5]]  # 0.9 apart along the normal
    expected = LAMBDA * EPSILON / (1.0 + OFFSET)
    assert weight(cells, [UP, UP], points, STEP, FROM) == pytest.approx(expected)
    assert weight(cells[::-1], [UP, UP], points[::-1], STEP, FROM) == pytest.approx(expected)
    assert weight(cells, [UP, UP], points) == pytest.approx(LAMBDA * EPSILON / OFFSET)  # the paper's


def test_a_voxel_without_normal_has_no_step() -> None:
    cells, points = [[0, 0, 1], [1, 0, 0]], [[0.5, 0.5, 1.9], [1.5, 0.5, 0.1]]
    assert weight(cells, [UP, np.full(3, np.nan)], points, STEP, FROM) == pytest.approx(LAMBDA * EPSILON / OFFSET)


def test_a_step_is_never_convex() -> None:
    bent = np.array([np.sin(0.2), 0.0, np.cos(0.2)])
    cells, points = [[0, 0, 1], [1, 0, 0]], [[0.5, 0.5, 1.6], [1.0, 0.5, 0.3]]
    assert weight(cells, [UP, bent], points) > LAMBDA
    assert weight(cells, [UP, bent], points, STEP) == pytest.approx(LAMBDA * EPSILON / (1.0 + OFFSET))


def test_a_step_where_normals_differ_by_more_than_one_keeps_their_difference() -> None:
    points = [[1.0, 0.0, -0.1], [0.0, 0.0, 1.9]]  # (1, 0, 1) / 2 . (1, 0, -2) = -0.5, a crease and no step yet
    crease = weight([[1, 0, 0], [0, 0, 1]], [UP, OUT], points, STEP, FROM)
    assert crease == pytest.approx(LAMBDA * EPSILON / (np.sqrt(2.0) - FROM + OFFSET))
    points[1][2] = 2.9  # and now -1
    assert weight([[1, 0, 0], [0, 0, 1]], [UP, OUT], points, STEP, FROM) == pytest.approx(crease)


@pytest.mark.parametrize("degrees", [[0.0, 12.0], [30.0, 45.0], [-20.0, 0.0]])
def test_the_outside_of_an_arc_is_convex_as_it_was(degrees: list[float]) -> None:
    squared = 2.0 - 2.0 * np.cos(np.radians(degrees[1] - degrees[0]))
    expected = LAMBDA * (1.0 + EPSILON) / (np.sqrt(squared) + OFFSET)
    assert weight_on_an_arc(degrees, 1.0, step=STEP, begin=FROM) == pytest.approx(expected)
    assert weight_on_an_arc(degrees, 1.0, step=1e-6) == pytest.approx(expected)  # an arc has no step at all


def test_a_smooth_hollow_costs_what_a_plane_does() -> None:
    hollow = weight_on_an_arc([0.0, 15.0], -1.0, begin=FROM)  # normals differ by 2 sin 7.5 degrees = 0.261
    assert hollow == pytest.approx(LAMBDA * EPSILON / OFFSET)
    assert weight_on_an_arc([0.0, 15.0], -1.0) == pytest.approx(LAMBDA * EPSILON / (0.26105 + OFFSET), rel=1e-4)


def test_a_crease_stays_cheap() -> None:
    crease = weight([[1, 0, 0], [0, 0, 1]], [UP, OUT], step=STEP, begin=FROM)
    assert crease == pytest.approx(LAMBDA * EPSILON / (np.sqrt(2.0) - FROM + OFFSET))
    narrow = weight_on_an_arc([0.0, 30.0], -1.0, begin=FROM)  # 0.518 in one voxel
    assert narrow == pytest.approx(LAMBDA * EPSILON / (0.51764 - FROM + OFFSET), rel=1e-4)


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 3.0), st.floats(0.0, 2.0))
def test_weights_are_at_least_zero_and_ours_are_the_papers_where_nothing_is_a_step_or_concave(
    seed: int, step: float, begin: float
) -> None:
    rng = np.random.default_rng(seed)
    cells, normals = rng.integers(-2, 3, (60, 3)).astype(np.int32), rng.normal(size=(60, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[:5] = np.nan
    points, edges = cells + rng.random((60, 3)), rng.permutation(60).reshape(30, 2).astype(np.int32)
    ours = normal_weights(edges, cells, points, normals, LAMBDA, EPSILON, OFFSET, step, begin)
    paper = normal_weights(edges, cells, points, normals, LAMBDA, EPSILON, OFFSET)
    n, p = normals[edges], points[edges]
    is_step = np.abs((0.5 * n.sum(axis=1) * (p[:, 0] - p[:, 1])).sum(axis=1)) > step
    convex = paper > 0.99 * LAMBDA / (2.0 + OFFSET)
    assert (ours >= 0.0).all() and np.isfinite(ours).all()
    assert (ours[convex & ~is_step] == paper[convex & ~is_step]).all()
    assert (ours[~convex & ~is_step] >= paper[~convex & ~is_step]).all()
    assert (ours[is_step] <= np.float32(LAMBDA * EPSILON / (1.0 + OFFSET))).all()


def test_the_size_of_voxels_does_not_matter() -> None:
    rng = np.random.default_rng(0)
    voxels, normals = rng.integers(0, 2, (50, 3)), rng.normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    edges = np.array([[i, i + 1] for i in range(49)], np.int32)
    in_cells = normal_weights(edges, voxels.astype(np.int32), voxels, normals, LAMBDA, EPSILON, OFFSET)
    in_metres = normal_weights(edges, 0.01 * voxels, voxels, normals, LAMBDA, EPSILON, OFFSET)
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
    points = rng.normal(size=(200, 3))  # that they do not enter
    assert normal_weights(edges, voxels, points, normals, LAMBDA, EPSILON, OFFSET) == pytest.approx(expected, rel=1e-5)
