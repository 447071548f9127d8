"""Graphs small enough to solve by hand."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest

from thingmap.datasets.frame import Intrinsics
from thingmap.factors.box_alignment import box_alignment_factor
from thingmap.factors.depth_centre import depth_centre_factor
from thingmap.factors.guard import position_guard, size_guard
from thingmap.factors.odometry import between_factor, gauge_prior
from thingmap.factors.solid import project_solids

X0, X1, L, S = (gtsam.symbol(c, i) for c, i in (("x", 0), ("x", 1), ("l", 0), ("s", 0)))
INTRINSICS = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
ALL_SEEN = np.ones(4, bool)


def solve(factors, values: gtsam.Values) -> gtsam.Values:
    graph = gtsam.NonlinearFactorGraph()
    for factor in factors:
        graph.add(factor)
    return gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()


def test_one_view_gives_position_and_size_where_the_depth_extent_is_known():
    radius, d = 0.19, 2.0
    box = project_solids(np.eye(4), np.eye(3), np.array([[0.0, 0.0, d]]), np.log([[radius] * 3]), INTRINSICS)[0][0]
    values = gtsam.Values()
    values.insert(X0, gtsam.Pose3())
    values.insertPoint3(L, np.array([0.1, 0.1, 1.7]))
    values.insert(S, np.log([0.1, 0.1, 0.1]))
    round_prior = gtsam.noiseModel.Diagonal.Sigmas([100.0, 100.0, 1e-6])  # one view cannot see the depth extent
    solution = solve(
        [
            gauge_prior(X0, np.eye(4), np.full(6, 1e-6)),
            depth_centre_factor(X0, L, np.array([0.0, 0.0, d]), 0.01, 0.02),
            box_alignment_factor(X0, L, S, box, ALL_SEEN, INTRINSICS, np.eye(3), 2.0),
            gtsam.PriorFactorVector(S, np.log([radius] * 3), round_prior),
        ],
        values,
    )
    np.testing.assert_allclose(solution.atPoint3(L), [0.0, 0.0, d], atol=1e-6)
    np.testing.assert_allclose(np.exp(solution.atVector(S)), radius, rtol=1e-6)


def test_two_views_give_position_and_all_three_sizes():
    """Exact measurements from two sides: everything returns to the truth from a start that is far off."""
    T0 = np.eye(4)
    T1 = np.eye(4)  # a quarter turn about the object: looks along -x at z = 2.5
    T1[:3, :3] = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    T1[:3, 3] = [2.5, 0.0, 2.5]
    center, half_axes = np.array([0.1, -0.05, 2.4]), np.array([0.2, 0.1, 0.3])
    R_upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # up is -y, as cameras see it
    factors = [
        gauge_prior(X0, T0, np.full(6, 1e-4)),
        between_factor(X0, X1, np.linalg.inv(T0) @ T1, np.diag([0.02] * 3 + [0.05] * 3) ** 2),
        position_guard(L, center + 0.3),
        size_guard(S, np.log([0.15, 0.15, 0.15])),
    ]
    for key, T in ((X0, T0), (X1, T1)):
        box = project_solids(T, R_upright, center[None], np.log(half_axes)[None], INTRINSICS)[0][0]
        seen_center = T[:3, :3].T @ (center - T[:3, 3])
        factors.append(depth_centre_factor(key, L, seen_center, 0.01, 0.03))
        factors.append(box_alignment_factor(key, L, S, box, ALL_SEEN, INTRINSICS, R_upright, 1.0))
    values = gtsam.Values()
    values.insert(X0, gtsam.Pose3())
    values.insert(X1, gtsam.Pose3(T1).retract(np.array([0.05, -0.05, 0.03, 0.1, -0.1, 0.05])))
    values.insertPoint3(L, center + np.array([0.15, -0.1, 0.2]))
    values.insert(S, np.log([0.15, 0.15, 0.15]))
    solution = solve(factors, values)
    np.testing.assert_allclose(solution.atPose3(X1).matrix(), T1, atol=1e-3)
    np.testing.assert_allclose(solution.atPoint3(L), center, atol=1e-3)
    np.testing.assert_allclose(np.exp(solution.atVector(S)), half_axes, rtol=3e-3)


def test_two_centres_average_by_their_information():
    """A point on the optical axis measured at 2.0 and 2.3 m: the range is the mean weighted by 1 / sigma^2.

    The second measurement has a quarter of the visibility, so twice the sigma and a quarter of the weight.
    """
    factors = [
        gauge_prior(X0, np.eye(4), np.full(6, 1e-6)),
        depth_centre_factor(X0, L, np.array([0.0, 0.0, 2.0]), 0.1, 0.5),
        depth_centre_factor(X0, L, np.array([0.0, 0.0, 2.3]), 0.1, 0.5, visibility=0.25),
    ]
    values = gtsam.Values()
    values.insert(X0, gtsam.Pose3())
    values.insertPoint3(L, np.array([0.01, 0.0, 2.1]))
    solution = solve(factors, values)
    np.testing.assert_allclose(solution.atPoint3(L), [0.0, 0.0, (4 * 2.0 + 2.3) / 5], atol=1e-5)


def test_a_hardly_visible_centre_is_not_vaguer_than_the_clamp():
    values = gtsam.Values()
    values.insert(X0, gtsam.Pose3())
    values.insertPoint3(L, np.array([0.0, 0.0, 2.2]))
    error = [
        depth_centre_factor(X0, L, np.array([0.0, 0.0, 2.0]), 0.1, 0.5, visibility).error(values)
        for visibility in (0.5, 0.1, 0.001)
    ]
    np.testing.assert_allclose(error, 0.5 * (0.2 / 0.5) ** 2 * np.array([0.5, 0.1, 0.1]))


@pytest.mark.parametrize("center", [[0.0, 0.0, 0.0], [0.0, np.nan, 1.0], [1.0, 2.0]])
def test_impossible_centres_are_refused(center):
    with pytest.raises(ValueError, match="center_camera"):
        depth_centre_factor(X0, L, np.array(center), 0.1, 0.1)


def test_sigmas_of_a_centre_must_be_positive():
    with pytest.raises(ValueError, match="sigmas"):
        depth_centre_factor(X0, L, np.array([0.0, 0.0, 1.0]), 0.0, 0.1)
