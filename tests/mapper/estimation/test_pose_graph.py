"""Which loop closures are wrong, by the pose graph alone."""

from __future__ import annotations

import pickle
from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X

from thingmap.factors.odometry import pose3
from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.estimation.pose_graph import PoseGraph, check_loops, solve_poses
from thingmap.mapper.estimation.records import DropLoop, Gauge, Loop, Motion, UpPrior, Visual

STEP = np.repeat([0.002, 0.004], 3)  # rad, m: sigmas of odometry from one keyframe to the next
LOOP = np.repeat([0.005, 0.01], 3)


class Laps:
    """Two laps of a camera; odometry is noisy.

    Attributes:
        truth: (M, 4, 4).
        poses: (M, 4, 4) by odometry alone.
        right, wrong: numbers of the loop closures.
    """

    def __init__(self, keyframes: int = 100, seed: int = 0, weak_at: int | None = None) -> None:
        self.rng, self.ledger = np.random.default_rng(seed), Ledger()
        angles = 4.0 * np.pi * np.arange(keyframes) / keyframes
        self.truth = np.array([_on_circle(angle) for angle in angles])
        self.half = keyframes // 2
        self.right: set[int] = set()
        self.wrong: set[int] = set()
        self.ledger.append(Gauge(self.truth[0], np.full(6, 1e-3)))
        self.ledger.append(UpPrior(np.array([0.0, 0.0, 1.0]), 0.1))
        poses = [self.truth[0]]
        for t in range(1, keyframes):
            sigmas = STEP if t != weak_at else np.repeat([0.3, 0.5], 3)
            step = self.measure(t - 1, t, sigmas)
            self.ledger.append(Motion(t - 1, t, step, np.diag(sigmas**2)))
            poses.append(poses[-1] @ step)
        self.poses = np.array(poses)

    def measure(self, a: int, b: int, sigmas: np.ndarray) -> np.ndarray:
        """T_a_b with noise."""
        exact = gtsam.Pose3(np.linalg.inv(self.truth[a]) @ self.truth[b])
        return exact.retract(sigmas * self.rng.normal(size=6)).matrix()

    def see_again(self, a: int) -> None:
        """A right closure between keyframe `a` and the one a lap later."""
        b = a + self.half
        self.right.add(self.ledger.append(Loop(a, b, self.measure(a, b, LOOP), np.diag(LOOP**2))))

    def mistake(self, a: int, b: int, error: np.ndarray | None = None) -> None:
        """A closure that is off by an error of its own, or by the (6,) tangent `error` at the world's origin."""
        own = np.concatenate([self.rng.normal(0.0, 0.3, 3), self.rng.normal(0.0, 0.6, 3)])
        right = gtsam.Pose3(self.measure(a, b, LOOP))
        if error is None:
            wrong = right.retract(own)
        else:  # as if everything at b were elsewhere: errors of neighbours agree
            moved = gtsam.Pose3.Expmap(error).compose(gtsam.Pose3(self.truth[b]))
            noise = LOOP * self.rng.normal(size=6)
            wrong = gtsam.Pose3(self.truth[a]).between(moved).retract(noise)
        self.wrong.add(self.ledger.append(Loop(a, b, wrong.matrix(), np.diag(LOOP**2))))


def least_squares(graph: PoseGraph, poses: np.ndarray) -> np.ndarray:
    """The optimum without any robust loss."""
    values = gtsam.Values()
    for t, T in enumerate(poses):
        values.insert(X(t), pose3(T))
    best = gtsam.LevenbergMarquardtOptimizer(graph.factors(robust=False), values).optimize()
    return np.array([best.atPose3(X(t)).matrix() for t in range(len(poses))])


def _on_circle(angle: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = (gtsam.Rot3.Rz(angle) * gtsam.Rot3.Rx(-np.pi / 2.0)).matrix()
    T[:3, 3] = 3.0 * np.cos(angle), 3.0 * np.sin(angle), 0.1 * np.sin(3.0 * angle)
    return T


@pytest.mark.parametrize("seed", range(3))
def test_right_closures_are_told_from_wrong_ones_exactly(seed):
    """12 right and 8 wrong in any order; the poses are those of the right ones alone."""
    laps = Laps(seed=seed)
    order = laps.rng.permutation(20)
    for i in order:
        a = int(laps.rng.integers(0, laps.half - 5))
        laps.see_again(a) if i < 12 else laps.mistake(a, laps.half + int(laps.rng.integers(0, laps.half)))
    graph = PoseGraph.of(laps.ledger)
    start = solve_poses(graph, laps.poses)
    check = check_loops(graph, start, probability=0.9999)
    assert check.inliers == laps.right and check.outliers == laps.wrong
    alone = PoseGraph(graph.gauge, graph.motions, {n: graph.questioned[n] for n in laps.right})
    best = least_squares(alone, laps.truth)
    np.testing.assert_allclose(check.poses, best, atol=1e-3)
    assert np.abs(start - best).max() > 2.0 * np.abs(check.poses - best).max()  # Huber alone lets the wrong ones pull


def test_the_threshold_is_the_chi_square_quantile_that_was_asked_for():
    """One closure against sure odometry, off by d^2 of 6 dof: 12.6 is the 95 %, 16.8 the 99, 22.5 the 99.9 % point."""
    for sigmas, probability, kept in ((3.7, 0.99, True), (3.7, 0.95, False), (4.3, 0.99, False), (4.3, 0.999, True)):
        laps = Laps(keyframes=20)
        exact = np.linalg.inv(laps.poses[2]) @ laps.poses[18]
        off = gtsam.Pose3(exact).retract(np.array([0.0, 0.0, 0.0, sigmas, 0.0, 0.0]) * 0.3).matrix()
        sure = tuple(replace(m, covariance=1e-10 * np.eye(6)) for m in laps.ledger if isinstance(m, Motion))
        loop = Loop(2, 18, off, 0.3**2 * np.eye(6))
        check = check_loops(PoseGraph(Gauge(laps.truth[0], np.full(6, 1e-6)), sure, {7: loop}), laps.poses, probability)
        assert (check.inliers == {7}) == kept and (check.outliers == {7}) != kept


def test_visual_motions_can_be_in_question_too():
    laps = Laps()
    right = laps.ledger.append(Visual(10, 11, laps.measure(10, 11, STEP), np.diag(STEP**2)))
    wrong = laps.ledger.append(Visual(20, 21, laps.measure(20, 22, STEP), np.diag(STEP**2)))
    check = check_loops(PoseGraph.of(laps.ledger, (Loop, Visual)), laps.poses)
    assert check.inliers == {right} and check.outliers == {wrong}


def test_what_was_dropped_is_not_in_question():
    laps = Laps()
    laps.see_again(3)
    laps.mistake(5, 60)
    laps.ledger.append(DropLoop(next(iter(laps.wrong))))
    assert PoseGraph.of(laps.ledger).questioned.keys() == laps.right


def test_without_loops_poses_stay_as_they_are():
    laps = Laps()
    check = check_loops(PoseGraph.of(laps.ledger), laps.poses)
    assert check.inliers == check.outliers == frozenset()
    np.testing.assert_array_equal(check.poses, laps.poses)


def test_a_ledger_without_a_first_keyframe_is_refused():
    with pytest.raises(ValueError, match="first keyframe"):
        PoseGraph.of(Ledger())


def test_a_check_can_be_made_in_another_process():
    """Arguments and answer pickle, and the answer is the same."""
    laps = Laps(keyframes=40)
    laps.see_again(3)
    laps.mistake(8, 35)
    graph = PoseGraph.of(laps.ledger)
    here = check_loops(graph, laps.poses)
    there = pickle.loads(pickle.dumps(check_loops(*pickle.loads(pickle.dumps((graph, laps.poses))))))
    assert (there.inliers, there.outliers) == (here.inliers, here.outliers)
    np.testing.assert_array_equal(there.poses, here.poses)


ELSEWHERE = np.array([0.0, 0.0, 0.4, 0.8, -0.6, 0.0])  # rad, m: one and the same mistake


def test_wrong_closures_that_agree_are_found_where_odometry_is_good():
    """Eight that agree with each other against three right ones: odometry contradicts all eight."""
    laps = Laps()
    for a in (5, 15, 30):
        laps.see_again(a)
    for a in range(20, 28):
        laps.mistake(a, a + laps.half, ELSEWHERE)
    check = check_loops(PoseGraph.of(laps.ledger), laps.poses)
    assert check.outliers == laps.wrong and check.inliers == laps.right


def test_behind_weak_odometry_one_wrong_closure_cannot_outvote_two_right_ones():
    """After one step known to 0.5 m and 17 degrees only, as when the camera was lost."""
    laps = Laps(weak_at=60)
    for a in (20, 30, 40):
        laps.see_again(a)
    laps.mistake(25, 25 + laps.half, ELSEWHERE)
    check = check_loops(PoseGraph.of(laps.ledger), laps.poses)
    assert check.outliers == laps.wrong and check.inliers == laps.right


def test_behind_weak_odometry_the_majority_wins_even_where_it_is_wrong():
    """What GNC cannot do: six wrong closures that agree, with odometry as weak as it is, outvote two right ones,
    and one wrong closure that nothing contradicts is believed. Whoever proposes loops there has to be sure of each."""
    laps = Laps(weak_at=60)
    for a in (20, 30):
        laps.see_again(a)
    for a in (22, 25, 28, 33, 36, 41):
        laps.mistake(a, a + laps.half, ELSEWHERE)
    check = check_loops(PoseGraph.of(laps.ledger), laps.poses)
    assert check.inliers == laps.wrong and check.outliers == laps.right
    alone = Laps(weak_at=60)
    alone.mistake(25, 25 + alone.half, ELSEWHERE)
    assert check_loops(PoseGraph.of(alone.ledger), alone.poses).inliers == alone.wrong
