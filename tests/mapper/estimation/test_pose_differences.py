"""How sure the relative pose of two keyframes is: exactly, by all measurements, and bounded by a path of them."""

from __future__ import annotations

from itertools import pairwise

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X

from thingmap.mapper.estimation.joint_marginals import JointMarginals
from thingmap.mapper.estimation.path_covariance import adjoints, path_covariances
from thingmap.mapper.estimation.records import Loop, Visual
from thingmap.mapper.estimation.smoother import Smoother

STEP = np.diag([0.01, 0.02, 0.03, 0.02, 0.03, 0.05]) ** 2


def chain(tools, keyframes: int = 6, seed: int = 0) -> Smoother:
    """Keyframes by odometry of large turns; nothing else is known of them."""
    rng, smoother = np.random.default_rng(seed), Smoother(tools.exact, tools.kinect)
    smoother.add_first(np.eye(4), np.full(6, 1e-3), np.array([0.0, -1.0, 0.0]), 0.01)
    for _ in range(keyframes - 1):
        smoother.add_keyframe(gtsam.Pose3.Expmap(rng.normal(0.0, 0.7, 6)).matrix(), STEP)
    smoother.update()
    return smoother


def test_one_step_is_as_sure_as_it_was_measured(tools):
    smoother = chain(tools)
    np.testing.assert_allclose(smoother.pose_difference_covariance(2, 3), STEP, rtol=1e-6, atol=1e-12)


def test_backwards_it_is_the_same_error_seen_from_the_other_end(tools):
    smoother = chain(tools)
    T_b_a = np.linalg.inv(smoother.pose(3)) @ smoother.pose(2)
    A = gtsam.Pose3(T_b_a).inverse().AdjointMap()
    expected = A @ STEP @ A.T
    np.testing.assert_allclose(smoother.pose_difference_covariance(3, 2), expected, rtol=1e-6, atol=1e-12)


def test_a_chain_is_as_sure_as_its_drawn_errors_say(tools):
    """Odometry is drawn again and again: errors of T_a_b spread as the covariance says (first order: small noise)."""
    smoother, rng, scale = chain(tools), np.random.default_rng(1), 0.1
    poses = [gtsam.Pose3(T) for T in smoother.poses()]
    steps = [a.between(b) for a, b in pairwise(poses)]
    mean, errors = poses[1].between(poses[5]), []
    for _ in range(4000):
        drawn = gtsam.Pose3()
        for step in steps[1:]:
            drawn = drawn.compose(step.retract(scale * np.sqrt(np.diag(STEP)) * rng.normal(size=6)))
        errors.append(mean.localCoordinates(drawn) / scale)
    expected = smoother.pose_difference_covariance(1, 5)
    whitened = np.linalg.solve(np.linalg.cholesky(expected), np.cov(np.array(errors).T))
    assert np.abs(np.linalg.solve(np.linalg.cholesky(expected), whitened.T) - np.eye(6)).max() < 0.1


def test_it_is_the_joint_marginal_through_numerical_derivatives(two_views, tools):
    """With landmarks in the graph; the Jacobian of T_a_b by both poses by central differences."""
    smoother = two_views((0.0, 0.0, 0.0), (0.3, 0.1, 0.0)).smoother
    smoother.update()
    graph, values = tools.solve_batch(smoother)
    joint = gtsam.Marginals(graph, values).jointMarginalCovariance([X(0), X(1)]).fullMatrix()
    a, b = values.atPose3(X(0)), values.atPose3(X(1))
    mean, J, h = a.between(b), np.zeros((6, 12)), 1e-6
    for i in range(12):
        ends = []
        for sign in (h, -h):
            d = np.zeros(12)
            d[i] = sign
            ends.append(mean.localCoordinates(a.retract(d[:6]).between(b.retract(d[6:]))))
        J[:, i] = (ends[0] - ends[1]) / (2.0 * h)
    expected = J @ joint @ J.T
    np.testing.assert_allclose(smoother.pose_difference_covariance(0, 1), expected, rtol=0.01, atol=1e-8)


def test_it_knows_of_what_came_since(tools):
    smoother = chain(tools)
    before = smoother.pose_difference_covariance(0, 5)
    T = np.linalg.inv(smoother.pose(0)) @ smoother.pose(5)
    smoother.add(Loop(0, 5, T, 1e-6 * np.eye(6)))
    smoother.update()
    after = smoother.pose_difference_covariance(0, 5)
    assert np.trace(after) < 1e-2 * np.trace(before)
    smoother._rebuild()
    np.testing.assert_allclose(smoother.pose_difference_covariance(0, 5), after, rtol=1e-3)


def test_joint_marginals_are_those_of_gtsam(two_views, tools):
    graph, values = tools.solve_batch(two_views((0.0, 0.0, 0.0), (0.3, 0.1, 0.0)).smoother)
    own, marginals = JointMarginals(graph, values), gtsam.Marginals(graph, values)
    for keys in ([X(1)], [L(2), X(0)], [X(1), L(1), X(0)]):
        expected = marginals.jointMarginalCovariance(keys)
        blocks = np.block([[expected.at(i, j) for j in keys] for i in keys])
        np.testing.assert_allclose(own.covariance(keys), blocks, rtol=1e-6, atol=1e-12)


def test_adjoints_are_those_of_gtsam():
    rng = np.random.default_rng(0)
    poses = [gtsam.Pose3.Expmap(rng.normal(size=6)) for _ in range(5)]
    expected = [pose.AdjointMap() for pose in poses]
    np.testing.assert_allclose(adjoints(np.array([pose.matrix() for pose in poses])), expected, atol=1e-12)


def test_along_a_chain_the_bound_is_exact(tools):
    smoother = chain(tools)
    for b in (5, 2):
        bounds = smoother.path_covariances(b)
        np.testing.assert_array_equal(bounds[b], np.zeros((6, 6)))
        for t in set(range(6)) - {b}:
            np.testing.assert_allclose(bounds[t], smoother.pose_difference_covariance(t, b), rtol=1e-5, atol=1e-10)


def test_with_more_measurements_the_bound_is_above_the_truth(tools):
    """And not far: a loop closure is a short cut for what lies behind it. A dropped one is not."""
    smoother = chain(tools, keyframes=30)
    for t in range(0, 29, 3):
        T = np.linalg.inv(smoother.pose(t)) @ smoother.pose(t + 1)
        smoother.add(Visual(t, t + 1, T, STEP))
    without = smoother.path_covariances(29)
    loop = smoother.add(Loop(2, 27, np.linalg.inv(smoother.pose(2)) @ smoother.pose(27), 0.5 * STEP))
    smoother.update()
    bounds = smoother.path_covariances(29)
    for t in range(29):
        excess = bounds[t] - smoother.pose_difference_covariance(t, 29)
        assert np.linalg.eigvalsh(excess)[0] > -1e-9
    assert np.trace(bounds[1]) < 0.3 * np.trace(without[1])
    smoother.drop_loops([loop])
    smoother.update()
    np.testing.assert_allclose(smoother.path_covariances(29), without, rtol=1e-6, atol=1e-12)


def test_where_no_path_leads_nothing_is_known():
    poses = np.tile(np.eye(4), (3, 1, 1))
    bounds = path_covariances(poses, [Visual(0, 1, np.eye(4), STEP)], 0)
    np.testing.assert_allclose(bounds[1], STEP)
    assert np.isinf(np.diag(bounds[2])).all()
    assert np.isinf(np.diag(path_covariances(poses, [], 0)[1])).all()
