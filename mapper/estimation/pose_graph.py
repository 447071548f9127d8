"""The keyframe poses by themselves, and which of their loop closures are wrong.

Graduated non-convexity (Yang, Antonante, Tzoumas and Carlone 2020) over the truncated squares

    sum over motions r^T Sigma^-1 r  +  sum over closures min(r^T Sigma^-1 r, c^2)

with c^2 a quantile of chi-square of 6 degrees of freedom, finds the largest set of closures that agree with odometry
and each other. It cannot tell wrong closures that agree with each other, and with odometry within its covariance, from
right ones: where odometry is weak, whoever proposes loops has to verify them by more than their number.

Everything here is a function of records and arrays, which pickle: it can run in another process.
"""

from __future__ import annotations

from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from ...factors.odometry import between_factor, gauge_prior, pose3
from .ledger import Ledger
from .records import DropLoop, Gauge, Link, Loop, Motion, ScanMatch, Visual

INLIER_WEIGHT = 0.5  # weights are 0 or 1 when it has converged


@dataclass(frozen=True, slots=True, eq=False)
class PoseGraph:
    """Where the first keyframe is, odometry and what is trusted like it, and what is in question, by its number."""

    gauge: Gauge
    motions: tuple[Link, ...]
    questioned: dict[int, Link]

    @classmethod
    def of(cls, ledger: Ledger, questioned: tuple[type, ...] = (Loop,)) -> PoseGraph:
        """What of a ledger is in the graph now.

        Args:
            ledger: of a map.
            questioned: kinds of links that may be wrong; neighbours' are checked against odometry as they come.

        Raises:
            ValueError: the ledger has no first keyframe.
        """
        gauges = [record for record in ledger if isinstance(record, Gauge)]
        if not gauges:
            raise ValueError("a pose graph needs a first keyframe, but the ledger has none")
        dropped = {record.record for record in ledger if isinstance(record, DropLoop)}
        links = {
            number: record
            for number, record in enumerate(ledger)
            if isinstance(record, Motion | Visual | ScanMatch | Loop) and number not in dropped
        }
        trusted = tuple(link for link in links.values() if not isinstance(link, questioned))
        return cls(gauges[0], trusted, {n: link for n, link in links.items() if isinstance(link, questioned)})

    def factors(self, robust: bool) -> gtsam.NonlinearFactorGraph:
        """Gauge, odometry, and then what is in question, in its order; that with Huber's loss where `robust`."""
        graph = gtsam.NonlinearFactorGraph()
        graph.add(gauge_prior(X(0), self.gauge.T_world_camera, self.gauge.sigmas))
        for m in self.motions:
            graph.add(between_factor(X(m.a), X(m.b), m.T_a_b, m.covariance))
        for m in self.questioned.values():
            graph.add(between_factor(X(m.a), X(m.b), m.T_a_b, m.covariance, robust=robust))
        return graph


@dataclass(frozen=True, slots=True, eq=False)
class LoopCheck:
    """Which records in question agree with odometry and each other, and the poses by these.

    Attributes:
        inliers, outliers: numbers of records in the ledger.
        poses: (M, 4, 4) `T_world_camera`.
    """

    inliers: frozenset[int]
    outliers: frozenset[int]
    poses: np.ndarray


def check_loops(graph: PoseGraph, poses: np.ndarray, probability: float = 0.99) -> LoopCheck:
    """Tells right closures from wrong ones; odometry is taken as right, within its covariance.

    Args:
        graph: the poses' measurements.
        poses: (M, 4, 4) `T_world_camera` to start from: the current estimate.
        probability: with which a right closure is taken as such.
    """
    if not graph.questioned:
        return LoopCheck(frozenset(), frozenset(), np.array(poses))
    parameters = gtsam.GncLMParams()
    parameters.setKnownInliers(list(range(1 + len(graph.motions))))
    solver = gtsam.GncLMOptimizer(graph.factors(robust=False), _values(poses), parameters)
    solver.setInlierCostThresholdsAtProbability(probability)
    best = solver.optimize()
    weights = solver.getWeights().ravel()[1 + len(graph.motions) :]
    right = {number for number, weight in zip(graph.questioned, weights, strict=True) if weight > INLIER_WEIGHT}
    return LoopCheck(frozenset(right), frozenset(graph.questioned.keys() - right), _poses(best, len(poses)))


def solve_poses(graph: PoseGraph, poses: np.ndarray) -> np.ndarray:
    """(M, 4, 4) poses at the optimum of the pose graph with Huber's loss, from (M, 4, 4) to start with."""
    best = gtsam.LevenbergMarquardtOptimizer(graph.factors(robust=True), _values(poses)).optimize()
    return _poses(best, len(poses))


def _values(poses: np.ndarray) -> gtsam.Values:
    values = gtsam.Values()
    for t, T in enumerate(poses):
        values.insert(X(t), pose3(T))
    return values


def _poses(values: gtsam.Values, count: int) -> np.ndarray:
    return np.array([values.atPose3(X(t)).matrix() for t in range(count)])
