"""Class and size by expectation propagation against exact answers: linear-Gaussian measurements of one or two sizes."""

from __future__ import annotations

import itertools

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import S
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import logsumexp, softmax
from scipy.stats import multivariate_normal

from thingmap.factors.size_prior import ClassSizePriors
from thingmap.mapper.estimation.record_factors import site_factor
from thingmap.mapper.estimation.size_site import Refreshed, SizeSite, initial_site, propagate

MUG = np.log([0.05, 0.05, 0.06])


def random_problem(seed: int, classes: int) -> tuple[ClassSizePriors, np.ndarray]:
    """Size priors with full covariances about a mug's size, and (K + 1,) log beliefs from scores."""
    rng = np.random.default_rng(seed)
    means = MUG + np.vstack([np.zeros(3), rng.normal(0.0, 0.35, (classes, 3)), [0.3, -0.2, 0.1]])
    roots = rng.normal(0.0, 0.12, (classes + 2, 3, 3)) + 0.12 * np.eye(3)
    covariances = roots @ roots.transpose(0, 2, 1) + 0.01 * np.eye(3)
    covariances[0], covariances[-1] = 0.6**2 * np.eye(3), np.eye(3)  # "not an object", and anything: wide
    priors = ClassSizePriors(tuple("abcdefgh"[:classes]), means, covariances, np.ones(classes, bool))
    return priors, np.log(rng.dirichlet(np.full(classes + 1, 2.0)))


def log_normal(x: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    return multivariate_normal(mean, covariance).logpdf(x)  # type: ignore[arg-type]


def components(k: int, outlier: float) -> list[tuple[int, float]]:
    """Rows of the Gaussians that class k's size follows, with log weights: its own, or the last one for outliers."""
    if k == 0 or outlier == 0.0:
        return [(k, 0.0)]
    return [(k, np.log1p(-outlier)), (-1, np.log(outlier))]


def enumerate_exactly(
    priors: ClassSizePriors, beliefs: list[np.ndarray], z: np.ndarray, noise: np.ndarray, outlier: float
) -> tuple[np.ndarray, np.ndarray]:
    """(N, K + 1) class posteriors and (N, 3) mean sizes of N objects measured together.

    z (3N,) = sizes + N(0, noise (3N, 3N)). Every assignment of classes gives one Gaussian: nothing is approximated.
    """
    count = len(beliefs)
    rows: list[tuple[tuple[int, ...], float, np.ndarray]] = []
    for classes in itertools.product(range(len(priors.mean) - 1), repeat=count):
        belief = float(sum(beliefs[i][k] for i, k in enumerate(classes)))
        for parts in itertools.product(*(components(k, outlier) for k in classes)):
            mean = np.concatenate([priors.mean[c] for c, _ in parts])
            prior = np.zeros((3 * count, 3 * count))
            for i, (c, _) in enumerate(parts):
                prior[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = priors.covariance[c]
            log_z = float(log_normal(z, mean, prior + noise))
            size = mean + prior @ np.linalg.solve(prior + noise, z - mean)
            rows.append((classes, belief + log_z + sum(w for _, w in parts), size))
    weight = softmax([w for _, w, _ in rows])
    posterior = np.zeros((count, len(priors.mean) - 1))
    for (classes, _, _), w in zip(rows, weight, strict=True):
        posterior[np.arange(count), classes] += w
    return posterior, (weight @ np.array([size for _, _, size in rows])).reshape(count, 3)


def marginals_of(factors: list[gtsam.NonlinearFactor], count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Mean and covariance of every S(j) of a linear graph, by GTSAM."""
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for factor in factors:
        graph.add(factor)
    for j in range(count):
        start.insert(S(j), MUG)
    values = gtsam.GaussNewtonOptimizer(graph, start).optimize()
    marginals = gtsam.Marginals(graph, values)
    return [(values.atVector(S(j)), marginals.marginalCovariance(S(j))) for j in range(count)]


def joint_measurement(z: np.ndarray, noise: np.ndarray) -> gtsam.CustomFactor:
    """z (6,) = [S(0), S(1)] + N(0, noise): two sizes that share an error, as two objects seen from one pose do."""

    def error(this: gtsam.CustomFactor, values: gtsam.Values, H: list[np.ndarray] | None) -> np.ndarray:
        if H is not None:
            H[0], H[1] = np.eye(6)[:, :3], np.eye(6)[:, 3:]
        return np.concatenate([values.atVector(S(0)), values.atVector(S(1))]) - z

    return gtsam.CustomFactor(gtsam.noiseModel.Gaussian.Covariance(noise), [S(0), S(1)], error)


def iterate(
    measurement: gtsam.NonlinearFactor, beliefs: list[np.ndarray], priors: ClassSizePriors, outlier: float
) -> list[Refreshed]:
    """Sites until they stand still, each refreshed from the graph that holds the others' latest."""
    sites = [initial_site(priors, softmax(belief)) for belief in beliefs]
    results: list[Refreshed] = []
    for _ in range(100):
        results, moved = [], 0.0
        for j, belief in enumerate(beliefs):
            factors = [measurement, *(site_factor(i, site) for i, site in enumerate(sites))]
            mean, covariance = marginals_of(factors, len(beliefs))[j]
            results.append(propagate(mean, covariance, sites[j], belief, priors, outlier))
            moved = max(moved, sites[j].distance(results[-1].site))
            sites[j] = results[-1].site
        if moved < 1e-9:
            return results
    raise AssertionError(f"sites still move by {moved}")


@pytest.mark.parametrize("outlier", [0.0, 0.1])
@pytest.mark.parametrize("classes", [2, 3, 4, 5])  # and "not an object"
@pytest.mark.parametrize("seed", range(4))
def test_one_measured_object_is_exact(seed, classes, outlier):
    priors, belief = random_problem(seed, classes)
    rng = np.random.default_rng([seed, 1])
    z, noise = MUG + rng.normal(0.0, 0.3, 3), np.diag(rng.uniform(0.02, 0.4, 3) ** 2)
    measurement = gtsam.PriorFactorVector(S(0), z, gtsam.noiseModel.Gaussian.Covariance(noise))
    (result,) = iterate(measurement, [belief], priors, outlier)
    posterior, size = enumerate_exactly(priors, [belief], z, noise, outlier)
    np.testing.assert_allclose(result.posterior, posterior[0], atol=1e-8)
    np.testing.assert_allclose(result.mean, size[0], atol=1e-8)


@pytest.mark.parametrize("outlier", [0.0, 0.1])
def test_one_object_against_numerical_integration(outlier):
    """The second oracle knows no Gaussian identity: it sums p(c) p(s | c) p(z | s) over a grid of sizes."""
    priors, belief = random_problem(7, 4)
    z, noise = MUG + np.array([0.2, -0.1, 0.15]), np.diag([0.15, 0.2, 0.25]) ** 2
    axes = [z[i] + np.linspace(-6.0, 6.0, 49) * np.sqrt(noise[i, i]) for i in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    own = np.array([log_normal(grid, m, C) for m, C in zip(priors.mean, priors.covariance, strict=True)])
    kinds = range(len(own) - 1)
    density = np.array([logsumexp([own[c] + w for c, w in components(k, outlier)], axis=0) for k in kinds])
    joint = density + belief[:, None] + log_normal(grid, z, noise)[None]
    weight = np.exp(joint - joint.max())
    weight /= weight.sum()
    measurement = gtsam.PriorFactorVector(S(0), z, gtsam.noiseModel.Gaussian.Covariance(noise))
    (result,) = iterate(measurement, [belief], priors, outlier)
    size = weight.sum(axis=0) @ grid
    offset = grid - size
    np.testing.assert_allclose(result.posterior, weight.sum(axis=1), atol=1e-6)
    np.testing.assert_allclose(result.mean, size, atol=1e-6)
    np.testing.assert_allclose(result.covariance, (weight.sum(axis=0)[:, None] * offset).T @ offset, atol=1e-6)


@pytest.mark.parametrize("outlier", [0.0, 0.1])
@pytest.mark.parametrize("seed", range(6))
def test_two_objects_that_share_an_error(seed, outlier):
    """Coupled sizes are no longer exact, but near: 0.01 in probability and in log size."""
    priors, first = random_problem(seed, 3)
    second = random_problem(seed + 100, 3)[1]
    rng = np.random.default_rng([seed, 2])
    shared, own = 0.1**2 * np.eye(3), np.diag(rng.uniform(0.05, 0.1, 6) ** 2)
    noise = np.kron(np.ones((2, 2)), shared) + own
    truth = np.concatenate([priors.mean[1], priors.mean[2]])
    z = truth + rng.multivariate_normal(np.zeros(6), noise)
    results = iterate(joint_measurement(z, noise), [first, second], priors, outlier)
    posterior, size = enumerate_exactly(priors, [first, second], z, noise, outlier)
    np.testing.assert_allclose([r.posterior for r in results], posterior, atol=0.01)
    np.testing.assert_allclose([r.mean for r in results], size, atol=0.01)


def test_what_one_object_is_tells_about_the_other():
    """Both boxes look 0.3 log units too large. The first is sure to be small, so the camera erred, for both."""
    small, large = np.full(3, -3.0), np.full(3, -2.7)
    priors = ClassSizePriors(
        ("small", "large"), np.array([small, small, large, small]),
        np.array([4.0, 0.0025, 0.0025, 4.0])[:, None, None] * np.eye(3),
        np.ones(2, bool),
    )  # fmt: skip
    sure, open_ = np.log([1e-6, 1.0, 1e-6]), np.log([1e-6, 0.5, 0.5])
    noise = np.kron(np.ones((2, 2)), 0.3**2 * np.eye(3)) + 0.02**2 * np.eye(6)
    z = np.concatenate([large, large])
    together = iterate(joint_measurement(z, noise), [sure, open_], priors, 0.0)[1]
    alone = iterate(joint_measurement(z, np.kron(np.eye(2), noise[:3, :3])), [sure, open_], priors, 0.0)[1]
    exact = enumerate_exactly(priors, [sure, open_], z, noise, 0.0)[0][1]
    assert exact[1] > 0.99
    np.testing.assert_allclose(together.posterior, exact, atol=0.01)
    assert alone.posterior[1] < 0.5


@given(seed=st.integers(0, 10_000), sigma=st.floats(0.01, 3.0), outlier=st.sampled_from([0.0, 0.05, 0.5]))
@settings(max_examples=60, deadline=None)
def test_a_site_is_a_gaussian_and_one_step_is_enough_for_one_object(seed, sigma, outlier):
    """The cavity of a lone object never depends on its site, so a second step changes nothing."""
    priors, belief = random_problem(seed, 4)
    rng = np.random.default_rng([seed, 3])
    z, information = MUG + rng.normal(0.0, 0.4, 3), np.eye(3) / sigma**2
    site = initial_site(priors, softmax(belief))
    results = []
    for _ in range(2):
        covariance = np.linalg.inv(information + site.information)
        mean = covariance @ (information @ z + site.information @ site.mean)
        results.append(propagate(mean, covariance, site, belief, priors, outlier))
        site = results[-1].site
    for result in results:
        assert result.posterior.sum() == pytest.approx(1.0)
        assert np.linalg.eigvalsh(result.site.information)[0] > 0.0
        assert np.linalg.eigvalsh(result.covariance)[0] > 0.0
    np.testing.assert_allclose(results[1].posterior, results[0].posterior, atol=1e-4)
    np.testing.assert_allclose(results[1].mean, results[0].mean, atol=1e-4)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_the_site_gives_the_graph_the_moments_of_the_mixture_where_it_can(seed):
    """Where the mixture is narrower than the cavity, cavity times site has its mean and covariance."""
    priors, belief = random_problem(seed, 3)
    z, information = MUG + np.random.default_rng([seed, 4]).normal(0.0, 0.2, 3), 0.05 * np.eye(3)
    covariance = np.linalg.inv(information + np.eye(3))
    mean = covariance @ (information @ z + MUG)
    result = propagate(mean, covariance, SizeSite(MUG, np.eye(3)), belief - np.array([30.0, 0.0, 0.0, 0.0]), priors)
    np.testing.assert_allclose(np.linalg.inv(information + result.site.information), result.covariance, atol=1e-6)
    got = result.covariance @ (information @ z + result.site.information @ result.site.mean)
    np.testing.assert_allclose(got, result.mean, atol=1e-6)


def test_a_site_stays_near_the_size_where_the_classes_are_two_peaks_apart():
    """The mixture is wider than the cavity: no Gaussian site exists, and what stands in must not pull for ever."""
    means = np.array([[-2.0] * 3, [-2.6] * 3, [-1.4] * 3, [-2.0] * 3])
    priors = ClassSizePriors(
        ("small", "large"), means, np.array([1.0, 0.01, 0.01, 1.0])[:, None, None] * np.eye(3), np.ones(2, bool)
    )
    information = np.eye(3) / 0.5**2
    result = propagate(
        np.full(3, -2.0), np.linalg.inv(information + np.eye(3)), SizeSite(np.full(3, -2.0), np.eye(3)),
        np.log([0.2, 0.4, 0.4]), priors,
    )  # fmt: skip
    assert np.linalg.eigvalsh(result.covariance)[-1] > 0.5**2
    assert np.abs(result.site.mean - result.mean).max() < 3.0
    pull = result.site.information @ (result.site.mean - result.mean)
    assert np.abs(pull).max() < 0.5


def test_unknown_sizes_leave_the_classes_to_the_scores(tools):
    priors = tools.make_priors(np.tile(MUG, (4, 1)), np.ones(4))
    belief = np.log([0.1, 0.2, 0.3, 0.4])
    result = propagate(MUG + 0.5, 0.01 * np.eye(3), initial_site(priors, softmax(belief)), belief, priors, 0.1)
    np.testing.assert_allclose(result.posterior, [0.1, 0.2, 0.3, 0.4], atol=1e-9)


@given(seed=st.integers(0, 10_000), order=st.permutations(range(4)))
@settings(max_examples=30, deadline=None)
def test_the_order_of_the_classes_does_not_matter(seed, order):
    priors, belief = random_problem(seed, 4)
    rows = np.array([0, *(k + 1 for k in order), 5])
    names = tuple(priors.classes[k] for k in order)
    shuffled = ClassSizePriors(names, priors.mean[rows], priors.covariance[rows], priors.known)
    site, z = SizeSite(MUG, np.eye(3)), MUG + 0.2
    one = propagate(z, 0.02 * np.eye(3), site, belief, priors, 0.1)
    other = propagate(z, 0.02 * np.eye(3), site, belief[rows[:-1]], shuffled, 0.1)
    np.testing.assert_allclose(other.posterior, one.posterior[rows[:-1]], atol=1e-12)
    np.testing.assert_allclose(other.mean, one.mean, atol=1e-12)


def test_the_distance_of_sites_is_zero_for_equal_ones_and_counts_what_would_move():
    site = SizeSite(MUG, 4.0 * np.eye(3))
    assert site.distance(site) == 0.0
    assert site.distance(SizeSite(MUG + np.array([0.5, 0.0, 0.0]), 4.0 * np.eye(3))) == pytest.approx(1.0)
    assert site.distance(SizeSite(MUG, 8.0 * np.eye(3))) == pytest.approx(3.0 * np.log(2.0))
