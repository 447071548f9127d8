"""What was measured of a size, what that says about the class, and the first site."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import logsumexp, softmax
from scipy.stats import multivariate_normal

from thingmap.factors.size_prior import load_size_priors
from thingmap.mapper.estimation.size_site import SizeSite, initial_site, measured_size, propagate, size_evidence

CLASSES = ("cup", "bowl", "bottle", "cereal box", "monitor", "chair")
PRIORS = load_size_priors(CLASSES)
QUICK = settings(max_examples=40, deadline=None)


def spread(rng: np.random.Generator) -> np.ndarray:
    root = rng.normal(size=(3, 3))
    return root @ root.T + 0.1 * np.eye(3)


@given(seed=st.integers(0, 10_000))
@QUICK
def test_what_was_measured_is_the_marginal_without_the_site(seed):
    rng = np.random.default_rng(seed)
    measured, mean = spread(rng), rng.normal(size=3)
    site = SizeSite(rng.normal(size=3), spread(rng))
    information = measured + site.information
    both = np.linalg.solve(information, measured @ mean + site.information @ site.mean)
    got, vector = measured_size(both, np.linalg.inv(information), site)
    np.testing.assert_allclose(got, measured, atol=1e-7)
    np.testing.assert_allclose(vector, measured @ mean, atol=1e-7)


def test_a_size_that_nobody_measured_has_next_to_no_information():
    site = SizeSite(np.array([-2.0, -2.0, -2.5]), 9.0 * np.eye(3))
    information, vector = measured_size(site.mean, np.linalg.inv(site.information * (1.0 - 1e-9)), site)
    assert np.linalg.eigvalsh(information).min() > 0.0 and np.abs(information).max() < 1e-5
    np.testing.assert_allclose(vector, 0.0, atol=1e-5)


@pytest.mark.parametrize("outlier", [0.0, 0.05, 0.5])
def test_size_evidence_is_the_density_of_the_measured_size(outlier):
    """Up to a constant: N(z; mu_k, Sigma_k + R), mixed with the wide one's for what is only ever seen in part."""
    z, R = PRIORS.mean[2] + np.array([0.1, -0.2, 0.3]), np.diag([0.1, 0.2, 0.3]) ** 2
    information = np.linalg.inv(R)
    got = size_evidence(information, information @ z, PRIORS, outlier)
    density = [multivariate_normal(m, C + R).logpdf(z) for m, C in zip(PRIORS.mean, PRIORS.covariance, strict=True)]  # type: ignore[arg-type]
    own, wide = np.array(density[:-1]), density[-1]
    expected = own.copy()
    if outlier:
        expected[1:] = [logsumexp([np.log1p(-outlier) + x, np.log(outlier) + wide]) for x in own[1:]]
    np.testing.assert_allclose(got - got[0], expected - expected[0], atol=1e-9)
    assert got.shape == (len(CLASSES) + 1,)


def test_no_size_alone_rules_a_class_out():
    z, information = np.array([3.0, 3.0, 3.0]), 100.0 * np.eye(3)  # twenty metres
    ruled, kept = (size_evidence(information, information @ z, PRIORS, outlier) for outlier in (0.0, 0.05))
    assert (ruled[1:] - ruled[0]).max() < -20.0
    np.testing.assert_allclose(kept[1:] - kept[0], np.log(0.05), atol=1e-3)


def test_propagation_and_size_evidence_agree():
    rng = np.random.default_rng(2)
    site, belief = initial_site(PRIORS, softmax(rng.normal(size=7))), rng.normal(size=7)
    information = np.diag([80.0, 40.0, 60.0]) + site.information
    mean = PRIORS.mean[1] + 0.2
    result = propagate(mean, np.linalg.inv(information), site, belief, PRIORS, 0.05)
    expected = size_evidence(*measured_size(mean, np.linalg.inv(information), site), PRIORS, 0.05)
    np.testing.assert_allclose(result.log_z - result.log_z[0], expected - expected[0], atol=1e-6)
    np.testing.assert_allclose(result.posterior, softmax(belief + result.log_z), atol=1e-9)


def test_the_size_enters_with_its_weight():
    belief, site = np.zeros(7), initial_site(PRIORS, np.full(7, 1.0 / 7.0))
    arguments = PRIORS.mean[1], 0.01 * np.eye(3), site, belief, PRIORS, 0.05
    full, half, off = (propagate(*arguments, weight=w) for w in (1.0, 0.5, 0.0))
    np.testing.assert_allclose(half.posterior, softmax(0.5 * full.log_z), atol=1e-9)
    np.testing.assert_allclose(off.posterior, 1.0 / 7.0, atol=1e-9)
    np.testing.assert_allclose(full.log_z, off.log_z)


def test_outliers_are_of_any_size_even_where_the_size_of_no_object_is_known():
    small = load_size_priors(CLASSES, background=(np.full(3, -4.0), 0.01 * np.eye(3)))
    z, information = np.array([1.0, 1.0, 1.0]), 100.0 * np.eye(3)
    got = size_evidence(information, information @ z, small, 0.05)
    assert np.all(got[1:] > got[0] + 10.0)


def test_the_first_site_is_the_mixture_of_the_class_sizes():
    sure = np.zeros(len(CLASSES) + 1)
    sure[2] = 1.0
    site = initial_site(PRIORS, sure)
    np.testing.assert_allclose(site.mean, PRIORS.mean[2])
    np.testing.assert_allclose(np.linalg.inv(site.information), PRIORS.covariance[2], atol=1e-9)
    wide = np.linalg.inv(initial_site(PRIORS, np.full(7, 1.0 / 7.0)).information)
    assert np.linalg.eigvalsh(wide - PRIORS.covariance[2])[0] > 0.0


def test_what_anything_is_has_no_part_in_the_first_site():
    other = replace(PRIORS, mean=np.vstack([PRIORS.mean[:-1], np.full(3, 9.0)]))
    posterior = np.full(7, 1.0 / 7.0)
    np.testing.assert_array_equal(initial_site(PRIORS, posterior).mean, initial_site(other, posterior).mean)
