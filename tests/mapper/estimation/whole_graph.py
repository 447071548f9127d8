"""The smoother's graph made anew from its ledger, and solved by other means."""

from __future__ import annotations

import gtsam
from gtsam.symbol_shorthand import L, S, X
from rooms import EXACT, KINECT

from thingmap.factors.odometry import pose3
from thingmap.mapper.estimation.record_factors import UP, FactorContext, record_factors, site_factor
from thingmap.mapper.estimation.records import Box, DepthCentre, NewLandmark
from thingmap.mapper.estimation.smoother import Smoother

Factors = list[gtsam.NonlinearFactor]


def ledger_factors(smoother: Smoother) -> Factors:
    """The factors of every record that counts, sites left out, made anew from the ledger."""
    context = FactorContext(EXACT, KINECT, smoother.R_world_upright, smoother.owner)
    factors: Factors = []
    for record in smoother.ledger:
        if isinstance(record, NewLandmark) and record.landmark not in smoother.sites:
            continue
        if isinstance(record, DepthCentre | Box) and smoother.owner(record.landmark) not in smoother.sites:
            continue
        factors += record_factors(record, context)
    return factors


def estimate(smoother: Smoother) -> gtsam.Values:
    """What the smoother says, as values to start a batch solver from."""
    values = gtsam.Values()
    for t, T in enumerate(smoother.poses()):
        values.insert(X(t), pose3(T))
    values.insert(UP, gtsam.Unit3(smoother.up()[0]))
    for j in smoother.sites:
        values.insertPoint3(L(j), smoother.position(j))
        values.insert(S(j), smoother.log_size(j))
    return values


def optimise(factors: Factors, start: gtsam.Values) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """Levenberg-Marquardt to the last digit."""
    graph = gtsam.NonlinearFactorGraph()
    for factor in factors:
        graph.add(factor)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-13)
    parameters.setAbsoluteErrorTol(1e-13)
    parameters.setMaxIterations(300)
    return graph, gtsam.LevenbergMarquardtOptimizer(graph, start, parameters).optimize()


def solve_batch(smoother: Smoother) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """The smoother's whole graph, from its ledger and its sites, solved at once."""
    sites = [site_factor(j, site) for j, site in smoother.sites.items()]
    return optimise(ledger_factors(smoother) + sites, estimate(smoother))
