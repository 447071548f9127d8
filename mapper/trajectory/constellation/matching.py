"""Constellations: things mapped anew after the camera drifted lie like old ones, and give the correction.

A correction T lays recent things on old ones. Against the hypothesis that the camera is somewhere else, where the
recent things lie anywhere, its log odds are

    log p(T) V_T + Σ_matched log [q V/n N(p_j - T p_i; 0, S_ij) e_i e_j Σ_k c_ik c_jk/π_k] + (n - matched) log(1 - q)
                 + Σ_missed log(1 - P_D e_j)

with n recent things in a volume V, existences e, class posteriors c of mean π, q the share of recent things that are
old ones, and "missed" the old things that T puts among the recent ones without a partner. V_T is the volume of the
posterior of T (Laplace's approximation): it pays for every place that was tried. A row of like cans gives several
corrections of nearly the same odds; each is weighed against the sum of the others, so that none is sure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...config import ConstellationConfig
from ...map.upright import upright_rotation
from .fit import Drift, fit_corrections, log_density
from .graph import consistent_pairs, edges_with_bounds
from .pairs import Constellation, centre_noise, compatible_pairs, in_order_of_size, spread_volume
from .search import grow_sets

HOPELESS = -10.0  # nats of evidence below which a correction is not worth the search

Visible = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, slots=True, eq=False)
class ConstellationMatch:
    """A correction that lays recent things on old ones.

    Attributes:
        T_old_recent: (4, 4), takes where recent things are in the world to where they are in the world of the old ones.
        pairs: ((i, j), ...) recent and old thing that are one, as indices into the constellations.
        evidence: nats, log odds of this correction against "somewhere else" alone.
        log_odds: of this correction against everything else, other corrections included.
        missed: old things that should have been mapped again here, and were not.
        covariance: (6, 6) in the right tangent of `T_old_recent` [rad, m].
    """

    T_old_recent: np.ndarray
    pairs: tuple[tuple[int, int], ...]
    evidence: float
    log_odds: float
    missed: int
    covariance: np.ndarray


def match_constellations(
    recent: Constellation,
    old: Constellation,
    up: np.ndarray,
    config: ConstellationConfig,
    visible: Visible | None = None,
    drift: Drift | None = None,
) -> list[ConstellationMatch]:
    """Corrections by which at least `config.min_matches` recent things are old ones, best first.

    To believe one is up to the caller: `log_odds` of at least `config.min_log_odds`.

    Args:
        recent, old: the two groups, sharing no thing.
        up: (3,) direction in the world; the same for both groups.
        config: thresholds and noise.
        visible: (M, 3) places among the recent things, world -> (M,) bool, whether a thing there would have been mapped
            lately. None: what is within `config.view_radius` of a recent thing would have.
        drift: what is known of the correction before. None: it may be any.
    """
    if min(len(recent), len(old)) < max(config.min_matches, 2):
        return []
    # the search stops at the first answers that are good enough: which these are must not hang on the things' order
    (recent, i), (old, j) = in_order_of_size(recent), in_order_of_size(old)
    U = upright_rotation(up)
    places = recent.positions @ U, old.positions @ U
    noise = centre_noise(recent, U, config), centre_noise(old, U, config)
    pairs, gain = compatible_pairs(recent, old, places[0], noise, config)
    if len(pairs) < config.min_matches:
        return []
    elsewhere = len(recent) * np.log1p(-config.seen_before) + config.prior_log_odds
    space = spread_volume(places[1], config.spread)
    least = HOPELESS - elsewhere - log_density(space, drift)
    sets = _search(places, noise, pairs, gain, least, config)
    if not len(sets):
        return []
    partners = np.where(sets >= 0, pairs[sets, 1], -1)
    fit = fit_corrections(*places, *noise, partners, config.sigma_tilt, space, drift)
    matched = partners >= 0
    worth = np.where(matched, gain[sets] - 0.5 * fit.misfit, 0.0).sum(axis=1)
    missed = _missed(fit.T, places, U, partners, visible, config)
    silence = missed @ np.log1p(-config.detection * old.existence)
    evidence = worth + silence + elsewhere + fit.log_prior + fit.log_volume
    kept = _distinct(partners, evidence)
    odds = _against_all_others(evidence[kept])
    turn = np.kron(np.eye(2), U)
    world = np.eye(4)
    world[:3, :3] = U
    return [
        ConstellationMatch(
            world @ fit.T[s] @ world.T,
            tuple(sorted((int(i[k]), int(j[partners[s, k]])) for k in np.flatnonzero(matched[s]))),
            float(evidence[s]),
            float(log_odds),
            int(missed[s].sum()),
            turn @ fit.covariance[s] @ turn.T,
        )
        for s, log_odds in zip(kept, odds, strict=True)
    ]


def _search(
    places: tuple[np.ndarray, np.ndarray],
    noise: tuple[np.ndarray, np.ndarray],
    pairs: np.ndarray,
    gain: np.ndarray,
    least: float,
    config: ConstellationConfig,
) -> np.ndarray:
    """(S, N) which pair each recent thing is in, -1 for none, by candidate correction that gains at least `least`."""
    S = noise[0][pairs[:, 0]] + noise[1][pairs[:, 1]]
    variance = np.stack([0.5 * (S[:, 0, 0] + S[:, 1, 1]), S[:, 2, 2]], axis=1)
    joined = consistent_pairs(*places, pairs, variance, config.sigma_tilt, config.gate)
    edges, bounds = edges_with_bounds(joined, pairs, gain)
    order = np.argsort(-bounds, kind="stable")
    order = order[bounds[order] > least]
    tilt, gate, baseline = config.sigma_tilt, config.gate, config.min_baseline
    limits = config.min_matches, least, config.max_corrections
    return grow_sets(*places, pairs, gain, variance, joined, edges[order], bounds[order], tilt, gate, baseline, *limits)


def _missed(
    T: np.ndarray,
    places: tuple[np.ndarray, np.ndarray],
    U: np.ndarray,
    partners: np.ndarray,
    visible: Visible | None,
    config: ConstellationConfig,
) -> np.ndarray:
    """(S, M) bool: old things that should have been mapped again under each correction and have no partner."""
    recent, old = places
    back = (old[None] - T[:, None, :3, 3]) @ T[:, :3, :3]
    if visible is None:
        apart = np.square(back).sum(axis=2)[..., None] - 2.0 * back @ recent.T + np.square(recent).sum(axis=1)
        seen = apart.min(axis=2) < config.view_radius**2
    else:
        seen = np.array(visible(back.reshape(-1, 3) @ U.T), dtype=bool).reshape(back.shape[:2])
    for row, mine in zip(seen, partners, strict=True):
        row[mine[mine >= 0]] = False
    return seen


def _distinct(partners: np.ndarray, evidence: np.ndarray) -> np.ndarray:
    """Rows, best first, without those that share more than half of their pairs with a better one: it is the same."""
    kept: list[int] = []
    for s in np.argsort(-evidence, kind="stable"):
        mine = partners[s] >= 0
        if all(2 * np.count_nonzero(mine & (partners[s] == partners[k])) <= mine.sum() for k in kept):
            kept.append(int(s))
    return np.array(kept)


def _against_all_others(evidence: np.ndarray) -> np.ndarray:
    """(S,) log odds of each against the others and against "somewhere else", whose evidence is 0."""
    all_evidence = np.append(evidence, 0.0)
    others = [np.logaddexp.reduce(np.delete(all_evidence, s)) for s in range(len(evidence))]
    return evidence - np.array(others)
