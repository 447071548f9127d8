"""The box factor: residuals by hand, halves, censored sides, derivatives of the whole robust factor."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.datasets.frame import Intrinsics
from thingmap.factors.box_alignment import box_alignment_factor
from thingmap.factors.guard import position_guard, size_guard
from thingmap.factors.robust import HUBER_WIDTH
from thingmap.factors.solid import project_solids
from thingmap.factors.visibility import VolumePart

X, L, S = gtsam.symbol("x", 0), gtsam.symbol("l", 0), gtsam.symbol("s", 0)
INTRINSICS = Intrinsics(640, 480, 500.0, 510.0, 319.5, 239.5)
ALL_SEEN = np.ones(4, bool)
SIGMA_PX = 4.0
EVERY_PART = pytest.mark.parametrize("part", list(VolumePart), ids=lambda part: part.name.lower())


def values_of(center, half_axes, pose=None) -> gtsam.Values:
    values = gtsam.Values()
    values.insert(X, pose or gtsam.Pose3())
    values.insertPoint3(L, np.array(center, float))
    values.insert(S, np.log(np.array(half_axes, float)))
    return values


def predicted_box(values: gtsam.Values) -> np.ndarray:
    T, center, size = values.atPose3(X).matrix(), values.atPoint3(L), values.atVector(S)
    return project_solids(T, np.eye(3), center[None], size[None], INTRINSICS)[0][0]


def factor(xyxy, seen=ALL_SEEN, part=VolumePart.WHOLE) -> gtsam.CustomFactor:
    return box_alignment_factor(X, L, S, np.asarray(xyxy, float), seen, INTRINSICS, np.eye(3), SIGMA_PX, part)


def part_of(box: np.ndarray, part: VolumePart) -> np.ndarray:
    """The half of a box, side by side."""
    x0, y0, x1, y1 = box
    u, v = (x0 + x1) / 2, (y0 + y1) / 2
    halves = {
        VolumePart.WHOLE: [x0, y0, x1, y1],
        VolumePart.TOP: [x0, y0, x1, v],
        VolumePart.BOTTOM: [x0, v, x1, y1],
        VolumePart.LEFT: [x0, y0, u, y1],
        VolumePart.RIGHT: [u, y0, x1, y1],
    }
    return np.array(halves[part])


@EVERY_PART
def test_residual_is_the_distance_of_the_sides_in_sigmas(part):
    values = values_of([0.1, -0.2, 2.0], [0.1, 0.2, 0.15])
    box = part_of(predicted_box(values), part)
    shift = np.array([1.0, -2.0, 3.0, 0.5])
    assert factor(box - shift, part=part).error(values) == pytest.approx(0.5 * np.sum((shift / SIGMA_PX) ** 2))
    assert factor(box, part=part).error(values) == pytest.approx(0.0, abs=1e-20)


@pytest.mark.parametrize("first", [VolumePart.TOP, VolumePart.LEFT], ids=["top_and_bottom", "left_and_right"])
def test_two_halves_know_the_object_as_well_as_the_whole(first):
    """From a guess that is off, both graphs arrive at the true object."""
    truth, start = values_of([0.1, -0.2, 2.0], [0.1, 0.2, 0.15]), values_of([0.14, -0.17, 2.0], [0.13, 0.2, 0.12])
    halves = (first, VolumePart(first + 1))
    for parts in ([VolumePart.WHOLE], halves):
        graph = gtsam.NonlinearFactorGraph()
        graph.add(gtsam.PriorFactorPose3(X, gtsam.Pose3(), gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)))
        known = gtsam.noiseModel.Diagonal.Sigmas(np.array([1e3, 1e3, 1e-4]))  # the range only
        graph.add(gtsam.PriorFactorPoint3(L, truth.atPoint3(L), known))
        only_depth = gtsam.noiseModel.Diagonal.Sigmas(np.array([1e3, 1e3, 1e-4]))  # half depth
        graph.add(gtsam.PriorFactorVector(S, truth.atVector(S), only_depth))
        for part in parts:
            graph.add(factor(part_of(predicted_box(truth), part), part=part))
        solved = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
        np.testing.assert_allclose(solved.atPoint3(L), truth.atPoint3(L), atol=1e-4)
        np.testing.assert_allclose(solved.atVector(S), truth.atVector(S), atol=1e-3)


def test_a_wrong_box_pulls_linearly():
    values = values_of([0.1, -0.2, 2.0], [0.1, 0.2, 0.15])
    shift = np.array([60.0, 0.0, 60.0, 0.0])
    length = np.linalg.norm(shift / SIGMA_PX)
    expected = HUBER_WIDTH * (length - HUBER_WIDTH / 2)
    assert factor(predicted_box(values) - shift).error(values) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("side", "outwards"), [(0, -1.0), (1, -1.0), (2, 1.0), (3, 1.0)], ids=["left", "top", "right", "bottom"]
)
def test_an_unseen_side_only_bounds(side, outwards):
    values = values_of([0.1, -0.2, 2.0], [0.1, 0.2, 0.15])
    seen = np.arange(4) != side
    for pixels, expected in [(-25.0, 0.0), (0.0, 0.0), (3.0, 3.0)]:
        reported = predicted_box(values)
        reported[side] += outwards * pixels  # the true side is at least there
        linear = factor(reported, seen).linearize(values)
        A, b = linear.jacobian()
        assert factor(reported, seen).error(values) == pytest.approx(0.5 * (expected / SIGMA_PX) ** 2, abs=1e-18)
        assert A[side].any() == (expected > 0.0)
        assert np.delete(A, side, axis=0).any(axis=1).all()
        assert b[side] == pytest.approx(outwards * expected / SIGMA_PX, abs=1e-9)


def test_a_clipped_box_may_be_drawn_some_pixels_off_the_border():
    """The volume reaches 40 px out of the image; detectors put the cut side anywhere near the border."""
    values = values_of([-1.30, 0.0, 2.0], [0.15, 0.1, 0.1])
    box = predicted_box(values)
    assert box[0] < -30.0 < box[2]
    for drawn in (-70.0, -20.0, 0.0, 6.0):
        clipped = np.array([drawn, *box[1:]])
        assert factor(clipped, np.array([False, True, True, True])).error(values) == pytest.approx(0.0, abs=1e-18)
        assert factor(clipped).error(values) > 1.0


@EVERY_PART
@settings(deadline=None, derandomize=True, max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    noise_px=st.floats(0.5, 60.0),
    seen=st.lists(st.booleans(), min_size=4, max_size=4),
)
def test_gradient_of_the_whole_factor(part, seed, noise_px, seen):
    """-A^T b of the linearised factor is the gradient of its robust error."""
    rng = np.random.default_rng(seed)
    pose = gtsam.Pose3(gtsam.Rot3.Expmap(0.2 * rng.normal(size=3)), rng.normal(size=3))
    center = pose.transformFrom(np.array([0.4 * rng.normal(), 0.4 * rng.normal(), rng.uniform(1.5, 4.0)]))
    values = values_of(center, rng.uniform(0.05, 0.4, 3), pose)
    grow = np.array([-1.0, -1.0, 1.0, 1.0]) * rng.uniform(1.0, noise_px + 1.0, 4)  # all sides away from their kinks
    box = part_of(predicted_box(values), part)
    shrink = 0.3 * np.tile(box[2:] - box[:2], 2) * [1, 1, -1, -1] * rng.uniform(0.2, 1.0, 4)
    linear_of = factor(box + (grow if rng.random() < 0.7 else shrink), np.array(seen), part)
    A, b = linear_of.linearize(values).jacobian()
    gradient, h = -A.T @ b, 1e-6

    def error(k: int, step: float) -> float:
        d = step * np.eye(12)[k]
        moved = values_of(values.atPoint3(L) + d[6:9], np.exp(values.atVector(S) + d[9:]), pose.retract(d[:6]))
        return linear_of.error(moved)

    numerical = np.array([(error(k, h) - error(k, -h)) / (2 * h) for k in range(12)])
    np.testing.assert_allclose(gradient, numerical, atol=1e-4 * (1.0 + np.abs(gradient).max()))


@EVERY_PART
def test_derivatives_of_every_side(part):
    """The linearised factor against differences of the predicted part's box, side by side."""
    pose = gtsam.Pose3(gtsam.Rot3.Expmap(np.array([0.1, -0.2, 0.05])), np.array([0.3, -0.1, 0.2]))
    values = values_of(pose.transformFrom(np.array([0.3, -0.25, 1.8])), [0.1, 0.2, 0.15], pose)
    box, h = part_of(predicted_box(values), part), 1e-6
    A, b = factor(box, part=part).linearize(values).jacobian()
    np.testing.assert_allclose(b, 0.0, atol=1e-9)

    def moved_box(k: int, step: float) -> np.ndarray:
        d = step * np.eye(12)[k]
        moved = values_of(values.atPoint3(L) + d[6:9], np.exp(values.atVector(S) + d[9:]), pose.retract(d[:6]))
        return part_of(predicted_box(moved), part)

    numerical = np.array([(moved_box(k, h) - moved_box(k, -h)) / (2 * h) for k in range(12)]).T
    np.testing.assert_allclose(A * SIGMA_PX, numerical, atol=1e-3, rtol=1e-5)


def test_the_middle_of_a_half_that_is_cut_off_only_bounds():
    """The object reaches over the left border beyond its middle: of the right half, the left side is cut off."""
    values = values_of([-1.30, 0.0, 2.0], [0.15, 0.1, 0.1])
    half = part_of(predicted_box(values), VolumePart.RIGHT)
    assert half[0] < -1.0 < half[2]
    cut, right_only = np.array([0.0, *half[1:]]), np.array([False, True, True, True])
    assert factor(cut, right_only, VolumePart.RIGHT).error(values) == pytest.approx(0.0, abs=1e-18)
    assert factor(cut, part=VolumePart.RIGHT).error(values) > 0.1


@EVERY_PART
def test_a_part_of_a_volume_at_the_camera_says_nothing(part):
    off = factor([300.0, 200.0, 340.0, 260.0], part=part)
    values = values_of([0.0, 0.0, 0.3], [0.4, 0.4, 0.4])
    A, b = off.linearize(values).jacobian()
    assert off.error(values) == 0.0 and not A.any() and not b.any()


def test_a_volume_at_the_camera_leaves_the_graph_solvable_with_guards_only():
    values = values_of([0.0, 0.0, 0.3], [0.4, 0.4, 0.4])
    off = factor([300.0, 200.0, 340.0, 260.0])
    A, b = off.linearize(values).jacobian()
    assert off.error(values) == 0.0 and not A.any() and not b.any()

    graph = gtsam.NonlinearFactorGraph()
    graph.add(gtsam.PriorFactorPose3(X, gtsam.Pose3(), gtsam.noiseModel.Isotropic.Sigma(6, 0.01)))
    graph.add(off)
    with pytest.raises(RuntimeError, match="Indeterminate"):
        gtsam.ISAM2().update(graph, values)
    graph.add(position_guard(L, np.array([0.0, 0.0, 2.0])))
    graph.add(size_guard(S, np.log([0.1, 0.1, 0.1])))
    isam = gtsam.ISAM2()
    isam.update(graph, values)
    np.testing.assert_allclose(isam.calculateEstimatePoint3(L), [0.0, 0.0, 2.0], atol=1e-9)
    np.testing.assert_allclose(np.exp(isam.calculateEstimateVector(S)), [0.1, 0.1, 0.1], atol=1e-9)


@pytest.mark.parametrize(
    ("box", "seen", "sigma", "what"),
    [
        ([0, 0, np.nan, 1], ALL_SEEN, 3.0, "xyxy"),
        ([10, 0, 5, 8], ALL_SEEN, 3.0, "xyxy"),
        ([0, 0, 5], ALL_SEEN, 3.0, "xyxy"),
        ([0, 0, 5, 5], np.ones(3, bool), 3.0, "sides_seen"),
        ([0, 0, 5, 5], ALL_SEEN, 0.0, "sigma_px"),
        ([0, 0, 5, 5], ALL_SEEN, np.inf, "sigma_px"),
    ],
)
def test_bad_measurements_are_refused(box, seen, sigma, what):
    with pytest.raises(ValueError, match=what):
        box_alignment_factor(X, L, S, np.array(box, float), seen, INTRINSICS, np.eye(3), sigma)


@pytest.mark.parametrize("part", [-1, 5])
def test_parts_that_do_not_exist_are_refused(part):
    with pytest.raises(ValueError, match="VolumePart"):
        factor([0.0, 0.0, 5.0, 5.0], part=part)
