"""How large things of a class are: a Gaussian on the log half-axes of each class, and what it says about a class.

Meger et al. (both papers) put a normal distribution on the size of each category. Here a volume lies along the axes of
the upright frame (z vertical) while the thing stands there turned by an unknown yaw, in one of its resting poses. With
l, w the two dimensions that are horizontal and theta the yaw, the extents of the volume are

    rectangle:  x = l |cos theta| + w |sin theta|,       y = l |sin theta| + w |cos theta|
    round:      x^2 = l^2 cos^2 theta + w^2 sin^2 theta,  y^2 = l^2 sin^2 theta + w^2 cos^2 theta

and z is the third dimension. The table gives the logs of length, width and height as a Gaussian (medians and spreads,
correlated by `CORRELATION`: a large mug is large every way). Yaw (uniform over a quarter turn, after which x and y only
trade places), sizes and resting poses are summed out by quadrature; the mean and covariance of log(x/2, y/2, z/2) are
the prior N(s; mu_k, Sigma_k).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .size_table import SizeEntry, plain_name, read_size_table

BUILT_IN = Path(__file__).with_name("class_sizes.yaml")
CORRELATION = 0.5  # between the logs of two dimensions within a class; our choice, not measured
FIT_SIGMA = 0.05  # log units on every axis: what boxes make of a thing is never exactly its size
WIDE_SIGMA = 1.0  # log units; "not an object" and classes without a size: a factor of 2.7 either way
_YAW_NODES, _YAW_WEIGHTS = np.polynomial.legendre.leggauss(12)  # on a quarter turn the extents have no kink
_SIZE_NODES, _SIZE_WEIGHTS = np.polynomial.hermite_e.hermegauss(5)


@dataclass(frozen=True, slots=True, eq=False)
class ClassSizePriors:
    """Gaussians on log half-axes (log of metres) along the axes of the upright frame, z vertical.

    Row 0 is "not an object", row k + 1 is `classes[k]`, the last row "anything": what is only ever seen in part.

    Attributes:
        classes: K names.
        mean: (K + 2, 3).
        covariance: (K + 2, 3, 3).
        known: (K,) False where nothing is known of the class; its Gaussian is the one of row 0, so that size says
            nothing for or against it.
    """

    classes: tuple[str, ...]
    mean: np.ndarray
    covariance: np.ndarray
    known: np.ndarray

    def log_evidence(self, information: np.ndarray, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What a measured size says about the class.

            log Z_k = log of the integral of N(s; mu_k, Sigma_k) exp(-s^T Lambda s / 2 + eta^T s) ds + a constant
                    = (eta^T C_k eta) / 2 + eta^T G_k mu_k - (mu_k^T Lambda G_k mu_k) / 2 - log |I + Sigma_k Lambda| / 2
            G_k = (I + Sigma_k Lambda)^-1,    C_k = G_k Sigma_k,    m_k = G_k (mu_k + Sigma_k eta)

        which needs no inverse of Lambda: it may be singular or zero.

        Args:
            information: (3, 3) Lambda, the size's information without the site (the cavity); eigenvalues below zero,
                which numerical noise leaves, count as zero.
            vector: (3,) eta = Lambda s for a measured s.

        Returns:
            log_z: (K + 2,) up to a constant common to all rows.
            means: (K + 2, 3) m_k, the size if the class is k.
            covariances: (K + 2, 3, 3) C_k.
        """
        eigenvalues, V = np.linalg.eigh((information + information.T) / 2.0)
        Lambda = (V * np.maximum(eigenvalues, 0.0)) @ V.T
        I_plus = np.eye(3) + self.covariance @ Lambda
        covariances = np.linalg.solve(I_plus, self.covariance)
        covariances = (covariances + covariances.transpose(0, 2, 1)) / 2.0
        from_prior = np.linalg.solve(I_plus, self.mean[:, :, None])[:, :, 0]
        means = from_prior + covariances @ vector
        fit = (means + from_prior) @ vector - np.einsum("ki,ij,kj->k", self.mean, Lambda, from_prior)
        return (fit - np.linalg.slogdet(I_plus)[1]) / 2.0, means, covariances


def load_size_priors(
    classes: Sequence[str],
    extra: Path | None = None,
    background: tuple[np.ndarray, np.ndarray] | None = None,
) -> ClassSizePriors:
    """Size priors of a detector's classes, from the built-in table and a user's own file of the same form.

    Case, `_` and `-` make no difference; names come before aliases, the user's file before the built-in one.

    Args:
        classes: of the detector.
        extra: the user's file.
        background: (3,) mean and (3, 3) covariance of the log half-axes of what is no object, where it is known;
            a wide Gaussian otherwise.

    Raises:
        InputError: for a file that is missing or not of the form.
    """
    by_name: dict[str, SizeEntry] = {}
    for path in (BUILT_IN, extra):
        table = {} if path is None else read_size_table(path)
        by_name |= {alias: entry for entry in table.values() for alias in entry.aliases}
        by_name |= table
    entries = [by_name.get(plain_name(name)) for name in classes]
    known = [entry for entry in entries if entry is not None]
    moments = {entry: marginal(entry) for entry in dict.fromkeys(known or by_name.values())}
    wide = np.mean([mean for mean, _ in moments.values()], axis=0), WIDE_SIGMA**2 * np.eye(3)
    null = wide if background is None else background
    rows = [null, *(null if entry is None else moments[entry] for entry in entries), wide]
    return ClassSizePriors(
        tuple(classes),
        np.array([mean for mean, _ in rows]),
        np.array([covariance for _, covariance in rows]),
        np.array([entry is not None for entry in entries], dtype=bool),
    )


def marginal(entry: SizeEntry) -> tuple[np.ndarray, np.ndarray]:
    """Mean (3,) and covariance (3, 3) of an entry's log half-axes over yaw and resting poses (the module's formula)."""
    standard = np.stack(np.meshgrid(*[_SIZE_NODES] * 3), axis=-1).reshape(-1, 3)
    weight = np.prod(np.meshgrid(*[_SIZE_WEIGHTS] * 3), axis=0).ravel()
    correlation = np.full((3, 3), CORRELATION) + (1.0 - CORRELATION) * np.eye(3)
    if entry.round:  # one diameter
        correlation[0, 1] = correlation[1, 0] = 1.0
    size = np.exp(np.log(entry.size) + entry.spread * (standard @ _root(correlation).T))
    log_half = np.concatenate([_log_half_axes(size, vertical, entry.round) for vertical in range(3)])
    weight = np.concatenate([share * np.outer(weight, _YAW_WEIGHTS).ravel() for share in entry.resting])
    weight /= weight.sum()
    mean = weight @ log_half
    offset = log_half - mean
    return mean, (weight[:, None] * offset).T @ offset + FIT_SIGMA**2 * np.eye(3)


def _log_half_axes(size: np.ndarray, vertical: int, is_round: bool) -> np.ndarray:
    """(N * yaws, 3) log half-axes of things of (N, 3) length, width, height resting with one of these vertical."""
    yaw = np.pi / 4.0 * (1.0 + _YAW_NODES)
    c, s = np.cos(yaw), np.sin(yaw)
    length, width = (size[:, i, None] for i in range(3) if i != vertical)
    if is_round and vertical == 2:
        x, y = np.hypot(length * c, width * s), np.hypot(length * s, width * c)
    else:
        x, y = length * c + width * s, length * s + width * c
    z = np.broadcast_to(size[:, vertical, None], x.shape)
    return np.log(np.stack([x, y, z], axis=-1) / 2.0).reshape(-1, 3)


def _root(correlation: np.ndarray) -> np.ndarray:
    """A matrix R with R R^T the correlation, which may be singular."""
    eigenvalues, vectors = np.linalg.eigh(correlation)
    return vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
