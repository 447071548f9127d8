"""Class and size of one landmark, brought to agree by expectation propagation.

The joint posterior of class c and log size s of one landmark is
    p(c, s | all) ∝ p(c) p(evidence | c) N(s; μ_c, Σ_c)^w · (what the graph says about s)
The graph holds a single Gaussian *site* on S in place of the class mixture. Each refresh divides the site out of the
graph's marginal (the cavity), multiplies the mixture in, and projects the result back onto a Gaussian:
    q_c ∝ p(c) p(evidence | c) Z_c^w,  Z_c = ∫ N(s; μ_c, Σ_c) cavity(s) ds,  site ← moments(Σ_c q_c ·) / cavity
with w the size's weight among the kinds of evidence (`existence.py`), 1 for the exact mixture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...factors.size_prior import ClassSizePriors

REACH = 1.0  # log units, between a site's mean and that of the mixture
MIN_INFORMATION = 1e-3  # of a site, 1/log-unit^2: a site never takes information away


@dataclass(frozen=True, slots=True, eq=False)
class SizeSite:
    """Gaussian stand-in for the class mixture on log half-axes: (3,) mean and (3, 3) information."""

    mean: np.ndarray
    information: np.ndarray

    def distance(self, other: SizeSite) -> float:
        """How much another site differs: Mahalanobis distance of the means plus change of log volume."""
        difference = other.mean - self.mean
        volume = np.linalg.slogdet(other.information)[1] - np.linalg.slogdet(self.information)[1]
        return float(difference @ self.information @ difference + abs(volume))


@dataclass(frozen=True, slots=True, eq=False)
class Refreshed:
    """Result of one expectation propagation step.

    Attributes:
        posterior: (K+1,) class probabilities, "not an object" first.
        log_z: (K+1,) log evidence of the size under each class.
        site: the new site.
        mean, covariance: (3,), (3, 3) of the log size under the exact mixture.
    """

    posterior: np.ndarray
    log_z: np.ndarray
    site: SizeSite
    mean: np.ndarray
    covariance: np.ndarray


def initial_site(priors: ClassSizePriors, posterior: np.ndarray) -> SizeSite:
    """The class mixture's own moments: the site of a landmark whose size nobody has measured."""
    mean, covariance = _moments(posterior, priors.mean[:-1], priors.covariance[:-1])
    return SizeSite(mean, np.linalg.inv(covariance))


def measured_size(mean: np.ndarray, covariance: np.ndarray, site: SizeSite) -> tuple[np.ndarray, np.ndarray]:
    """(3, 3) information and (3,) information times mean of a log size without its site: what was measured of it."""
    information = np.linalg.inv(covariance)
    vector = information @ mean - site.information @ site.mean
    return _positive(information - site.information, 1e-6), vector


def size_evidence(
    information: np.ndarray, vector: np.ndarray, priors: ClassSizePriors, outlier: float = 0.0
) -> np.ndarray:
    """(K+1,) log evidence of each class by a log size measured with (3, 3) information, (3,) information times mean."""
    return _with_outliers(priors.log_evidence(information, vector)[0], outlier)[0]


def propagate(
    mean: np.ndarray,
    covariance: np.ndarray,
    site: SizeSite,
    log_belief: np.ndarray,
    priors: ClassSizePriors,
    outlier: float = 0.0,
    weight: float = 1.0,
) -> Refreshed:
    """One expectation propagation step.

    Args:
        mean, covariance: (3,), (3, 3) of the graph's marginal on the log size, the site included.
        site: the site that the graph holds now.
        log_belief: (K+1,) log prior plus log evidence of each class, up to a constant.
        priors: class size priors.
        outlier: share of objects of which only a part is ever measured (a chair behind a table): their size follows
            the wide prior of the last row, so that no size alone can rule a class out.
        weight: power of the size among the kinds of evidence.
    """
    cavity, vector = measured_size(mean, covariance, site)
    log_z, means, covariances = priors.log_evidence(cavity, vector)
    log_z, share = _with_outliers(log_z, outlier)
    posterior = _softmax(weight * log_z + log_belief)
    weights = np.append(posterior * (1.0 - share), posterior @ share)
    mixed_mean, mixed_covariance = _moments(weights, means, covariances)
    site = _divide(mixed_mean, mixed_covariance, cavity, vector)
    return Refreshed(posterior, log_z, site, mixed_mean, mixed_covariance)


def _divide(mean: np.ndarray, covariance: np.ndarray, cavity: np.ndarray, vector: np.ndarray) -> SizeSite:
    """The Gaussian that turns the cavity (information, information vector) into the given moments.

    Where the moments are wider than the cavity no such Gaussian exists: in those directions the site is next to
    nothing, centred on the mean. (Keeping the mean exactly would take a site of little information infinitely far away,
    which pulls for ever.) Nor may a site of any information lie further than `REACH` from the mean: the cavity comes
    from a graph that is linearised elsewhere, and what little it is off would take the site anywhere.
    """
    target = np.linalg.inv(covariance)
    values, axes = np.linalg.eigh((target - cavity + (target - cavity).T) / 2.0)
    along = axes.T @ (target @ mean - vector)
    clamped = values < MIN_INFORMATION
    values = np.where(clamped, MIN_INFORMATION, values)
    centre = axes.T @ mean
    along = values * np.where(clamped, centre, centre + np.clip(along / values - centre, -REACH, REACH))
    return SizeSite(axes @ (along / values), (axes * values) @ axes.T)


def _with_outliers(log_z: np.ndarray, outlier: float) -> tuple[np.ndarray, np.ndarray]:
    """(K+1,) log evidence of each class's size prior mixed with the wide one (the last), and the wide one's share."""
    own, wide = log_z[:-1], log_z[-1]
    if outlier <= 0.0:
        return own, np.zeros(len(own))
    wide = np.log(outlier) + wide
    mixed = np.logaddexp(np.log1p(-outlier) + own, wide)
    mixed[0] = wide
    share = np.exp(wide - mixed)
    mixed[0], share[0] = own[0], 0.0
    return mixed, share


def _moments(weights: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    mean = weights @ means
    difference = means - mean
    covariance = np.einsum("k,kij->ij", weights, covariances) + (weights[:, None] * difference).T @ difference
    return mean, covariance


def _positive(matrix: np.ndarray, floor: float) -> np.ndarray:
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2.0)
    return (vectors * np.maximum(values, floor)) @ vectors.T


def _softmax(x: np.ndarray) -> np.ndarray:
    e = np.exp(x - x.max())
    return e / e.sum()
