"""Constellations as arrays, and which recent thing may be which old one, before any geometry."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ...config import ConstellationConfig


@dataclass(frozen=True, slots=True, eq=False)
class Constellation:
    """Things as arrays.

    Attributes:
        numbers: (N,) of the landmarks.
        positions: (N, 3) world, metres.
        covariances: (N, 3, 3) square metres, against each other: without what they share, such as the camera's drift.
        class_posteriors: (N, K) class probabilities of the thing, given that it is one.
        log_sizes: (N, 3) log half-axes in the upright frame.
        existence: (N,) probabilities.
    """

    numbers: np.ndarray
    positions: np.ndarray
    covariances: np.ndarray
    class_posteriors: np.ndarray
    log_sizes: np.ndarray
    existence: np.ndarray

    def __len__(self) -> int:
        return len(self.numbers)


def in_order_of_size(things: Constellation) -> tuple[Constellation, np.ndarray]:
    """The things in an order that neither their numbering nor the axes of the world decide, and (N,) where each was."""
    order = np.lexsort(things.log_sizes.T)
    arrays = (getattr(things, field.name)[order] for field in fields(things))
    return Constellation(*arrays), order


def centre_noise(things: Constellation, U: np.ndarray, config: ConstellationConfig) -> np.ndarray:
    """(N, 3, 3) upright, square metres: covariance of a centre among its neighbours."""
    values, vectors = np.linalg.eigh(U.T @ things.covariances @ U)
    values = np.clip(values, 0.0, config.sigma_limit**2)
    extent = config.sigma_extent * np.exp(things.log_sizes.mean(axis=1))
    floor = config.sigma_position**2 + extent**2
    return (vectors * values[:, None]) @ np.swapaxes(vectors, 1, 2) + floor[:, None, None] * np.eye(3)


def compatible_pairs(
    recent: Constellation,
    old: Constellation,
    places: np.ndarray,
    noise: tuple[np.ndarray, np.ndarray],
    config: ConstellationConfig,
) -> tuple[np.ndarray, np.ndarray]:
    """(P, 2) pairs that may be one thing, in the order of the recent ones, and (P,) nats they say at no misfit."""
    shares = np.concatenate([recent.class_posteriors, old.class_posteriors]).mean(axis=0)
    alike = (recent.class_posteriors / np.maximum(shares, 1e-12)) @ old.class_posteriors.T
    trust = (1.0 - config.class_error) ** 2  # that both posteriors say something
    alike = trust * alike + 1.0 - trust
    # the world's horizontal axes are others before and after a drift in yaw: the footprint's diagonal hardly changes
    sizes = _height_and_diagonal(recent)[:, None] - _height_and_diagonal(old)
    unlike = np.square(sizes).sum(axis=2) / config.sigma_size**2
    pairs = np.argwhere((alike > config.min_class_ratio) & (unlike < config.gate))
    i, j = pairs.T
    odds = config.seen_before / (1.0 - config.seen_before)
    gain = np.log(alike[i, j] * odds * spread_volume(places, config.spread) / len(recent)) - 0.5 * unlike[i, j]
    gain += np.log(np.maximum(recent.existence[i] * old.existence[j], 1e-12))
    gain -= 0.5 * np.log(np.linalg.det(2.0 * np.pi * (noise[0][i] + noise[1][j])))
    best = np.argsort(-gain, kind="stable")[: min(config.max_pairs, np.count_nonzero(gain > 0.0))]
    kept = np.sort(best)
    return pairs[kept], gain[kept]


def _height_and_diagonal(things: Constellation) -> np.ndarray:
    """(N, 2) log metres."""
    half = np.exp(things.log_sizes)
    return np.log(np.stack([half[:, 2], np.hypot(half[:, 0], half[:, 1])], axis=1))


def spread_volume(places: np.ndarray, spread: float) -> float:
    """Cubic metres that things lie in: that of the uniform density with the entropy of their normal distribution."""
    apart = places - places.mean(axis=0)
    scatter = apart.T @ apart / len(places) + spread**2 * np.eye(3)
    return float(np.sqrt(np.linalg.det(2.0 * np.pi * np.e * scatter)))
