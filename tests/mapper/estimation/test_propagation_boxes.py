"""Expectation propagation through real box factors: two objects seen from uncertain poses, against enumeration.

The oracle optimises the whole graph once per assignment of size priors and weighs the optima by Laplace's evidence,
exp(-f(x*)) / sqrt(|H|). Boxes are not linear in the log size, so the oracle and the smoother's single linearisation
differ a little even where classes are certain: 0.01 in probability where a class has more than 0.8, 0.02 where the
classes are closer (worst of the cases below: 0.016), 0.01 in log size.
"""

from __future__ import annotations

import itertools

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import S
from scipy.special import softmax

from thingmap.factors.size_prior import ClassSizePriors
from thingmap.mapper.estimation.size_site import Refreshed, initial_site, propagate

HALF_AXES = (0.1, 0.15, 0.2)
PLACES = ((0.0, 0.0, 0.0), (0.3, -0.5, 0.1))
LOOSE = np.diag(np.repeat([0.02**2, 0.05**2], 3))  # of a step of odometry, rad^2 and m^2


def make_problem(seed: int, tools, sure: float) -> tuple[ClassSizePriors, list[np.ndarray]]:
    """Three classes a few percent apart in size and "not an object"; two objects' log beliefs."""
    rng = np.random.default_rng(seed)
    base = np.log(HALF_AXES)
    priors = tools.make_priors(np.vstack([base - 0.2, base + rng.normal(0.0, 0.08, (3, 3))]), [0.8, 0.12, 0.12, 0.15])
    return priors, list(np.log(rng.dirichlet(np.full(4, sure), 2) + 1e-4))


def make_room(tools, priors: ClassSizePriors, beliefs: list[np.ndarray]):
    """The first pose is held; objects are seen from the second and third only, which odometry knows to 5 cm."""
    room = tools.Room()
    for position in ((2.0, 0.0, 0.3), (1.5, 1.3, 0.3), (0.2, 1.9, 0.5)):
        room.add_camera(tools.look_at(position), covariance=LOOSE)
    for j, (place, belief) in enumerate(zip(PLACES, beliefs, strict=True), 1):
        room.add_object(j, place, HALF_AXES, initial_site(priors, softmax(belief)))
        for keyframe in (1, 2):
            room.see(keyframe, j, sigma_px=4.0)
    room.smoother.update()
    return room


def propagate_to_the_end(room, priors: ClassSizePriors, beliefs: list[np.ndarray], outlier: float) -> list[Refreshed]:
    smoother, results = room.smoother, []
    for _ in range(30):
        results, moved = [], 0.0
        for j, belief in enumerate(beliefs, 1):
            log_size, covariance = smoother.log_size(j), smoother.log_size_covariance(j)
            results.append(propagate(log_size, covariance, smoother.sites[j], belief, priors, outlier))
            moved = max(moved, smoother.sites[j].distance(results[-1].site))
            smoother.set_site(j, results[-1].site)
            for _ in range(3):
                smoother.update()
        if moved < 1e-6:
            return results
    raise AssertionError(f"sites still move by {moved}")


def enumerate_graph(tools, room, priors: ClassSizePriors, beliefs: list[np.ndarray], outlier: float):
    """(2, K + 1) class posteriors and (2, 3) mean log sizes by Laplace's evidence of every assignment."""
    factors, start = tools.ledger_factors(room.smoother), tools.estimate(room.smoother)
    kinds = range(len(priors.mean) - 1)  # what is anything has the size of what is no object
    evidence, sizes = np.empty((len(kinds), len(kinds))), np.empty((len(kinds), len(kinds), 2, 3))
    for pair in itertools.product(kinds, repeat=2):
        own = [
            gtsam.PriorFactorVector(S(j), priors.mean[c], gtsam.noiseModel.Gaussian.Covariance(priors.covariance[c]))
            for j, c in enumerate(pair, 1)
        ]
        graph, best = tools.optimise(factors + own, start)
        curvature = np.linalg.slogdet(graph.linearize(best).hessian()[0])[1]
        norm = sum(np.linalg.slogdet(priors.covariance[c])[1] for c in pair)
        evidence[pair] = -graph.error(best) - 0.5 * (curvature + norm)
        sizes[pair] = best.atVector(S(1)), best.atVector(S(2))
    # share[k, c]: how much of class k follows the size prior c, its own or the wide one
    share = (1.0 - outlier) * np.eye(len(kinds))
    share[:, 0] += outlier
    weight = np.exp(evidence - evidence.max())
    joint = np.einsum("i,j,ia,jb,ab->ijab", *np.exp(beliefs), share, share, weight)
    joint /= joint.sum()
    posterior = np.array([joint.sum(axis=(1, 2, 3)), joint.sum(axis=(0, 2, 3))])
    return posterior, np.einsum("ijab,abnd->nd", joint, sizes)


@pytest.mark.parametrize("outlier", [0.0, 0.1])
@pytest.mark.parametrize("sure", [0.3, 2.0])
@pytest.mark.parametrize("seed", range(5))
def test_two_objects_and_uncertain_poses(tools, seed, sure, outlier):
    priors, beliefs = make_problem(seed, tools, sure)
    room = make_room(tools, priors, beliefs)
    posterior, sizes = enumerate_graph(tools, room, priors, beliefs, outlier)
    results = propagate_to_the_end(room, priors, beliefs, outlier)
    assert max(np.abs(p - softmax(b)).max() for p, b in zip(posterior, beliefs, strict=True)) > 0.01  # sizes speak
    for result, exact, size in zip(results, posterior, sizes, strict=True):
        np.testing.assert_allclose(result.posterior, exact, atol=0.01 if exact.max() > 0.8 else 0.02)
        np.testing.assert_allclose(result.mean, size, atol=0.01)


def test_a_sure_neighbour_settles_the_scale_of_a_view_from_an_unknown_distance(tools):
    """Odometry along the viewing direction is unknown to 0.3 m: near small things look like far large ones.

    Positions come from the first view, boxes from the second. Both objects' boxes fit the small class from 2 m and the
    large one from further away, so what the neighbour is tells what the other one is.
    """
    small, large = np.log(HALF_AXES), np.log(HALF_AXES) + 0.15
    priors = tools.make_priors(np.array([small - 0.2, small, large]), [0.8, 0.07, 0.07])
    undecided, outcome = np.log([0.02, 0.49, 0.49]), []
    for neighbour in (np.log([0.01, 0.98, 0.01]), np.log([0.01, 0.01, 0.98])):
        beliefs, room = [neighbour, undecided], tools.Room()
        for covariance in (LOOSE, np.diag([1e-6, 1e-6, 1e-6, 1e-4, 1e-4, 0.3**2])):
            room.add_camera(tools.look_at((2.0, 0.0, 0.3)), covariance=covariance)
        for j, (place, belief) in enumerate(zip(PLACES, beliefs, strict=True), 1):
            room.add_object(j, place, HALF_AXES, initial_site(priors, softmax(belief)))
            room.see_centre(0, j)
            room.see_box(1, j, sigma_px=4.0)
        room.smoother.update()
        posterior, _ = enumerate_graph(tools, room, priors, beliefs, 0.0)
        result = propagate_to_the_end(room, priors, beliefs, 0.0)[1]
        outcome.append((posterior[1, 1], result.posterior[1]))
    (exact_small, small_beside_small), (exact_large, small_beside_large) = outcome
    assert exact_small > exact_large + 0.1
    assert small_beside_small == pytest.approx(exact_small, abs=0.05)  # two peaks, so a Gaussian only comes near
    assert small_beside_large == pytest.approx(exact_large, abs=0.05)
