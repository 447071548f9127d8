"""The sums of `information_gain.py`, compiled."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ...factors.score_model import BINS, TRUNCATION

SCORE_BINS = 12  # of width 1/12: finer ones change no gain by 1 %


@njit(cache=True)
def look_gains(
    numbers, visible, expected, prior, groups, like, steady, counts, own, sigma, background, rates, confusion, gains
):
    """Fill gains (M,) of M looks at things; arguments as of `Questions`."""
    J = like.shape[1]
    likelihood = np.empty((1 + J * SCORE_BINS, J + 1))
    mean, width = np.empty(J), np.empty(J)
    for m in range(len(numbers)):
        n, hidden = numbers[m], 1.0 - visible[m]
        if not expected[m] > 0.0 or hidden > TRUNCATION:
            continue
        place = min(max(hidden * BINS - 0.5, 0.0), BINS - 1.0)  # as in `ScoreModel.own_parameters`
        left = min(int(place), BINS - 2)
        share = place - left
        for j in range(J):
            mean[j] = (1.0 - share) * own[n, j, left] + share * own[n, j, left + 1]
            width[j] = (1.0 - share) * sigma[n, j, left] + share * sigma[n, j, left + 1]
        fill_likelihood(
            likelihood, expected[m], like[n], steady[n], counts[n], mean, width, background[n], rates[n], confusion
        )
        gains[m] = _information(prior[n], groups[n], likelihood)


@njit(cache=True)
def fill_likelihood(likelihood, expected, like, steady, counts, mean, width, background, rates, confusion):
    """p(o | h): row 0 is "not detected", then a row for each name and score bin."""
    J = len(like)
    others = max(counts.sum() - 1.0, 1.0)
    likelihood[0, 0] = 1.0 - expected * rates[0]
    likelihood[0, 1:] = 1.0 - expected * rates[1]
    false, right = np.empty(SCORE_BINS), np.empty(SCORE_BINS)
    for j in range(J):
        _fill_bins(false, background[j, 0], background[j, 1])
        _fill_bins(right, mean[j], width[j])
        for s in range(SCORE_BINS):
            row = 1 + j * SCORE_BINS + s
            likelihood[row, 0] = expected * rates[0] * like[j] * false[s]
            for k in range(J):
                wrong = confusion * (counts[j] - (1.0 if j == k else 0.0)) / others / SCORE_BINS
                honest = wrong + ((1.0 - confusion) * right[s] if j == k else 0.0)
                one = like[k] / max(counts[k], 1.0)  # a class does not look like itself by mistake
                mistaken = (like[j] - (one if j == k else 0.0)) / max(1.0 - one, 1e-12) * false[s]
                p = (1.0 - steady[k]) * honest + steady[k] * mistaken
                likelihood[row, 1 + k] = expected * rates[1] * p


@njit(cache=True)
def _information(prior, groups, likelihood):
    """Bits, by the sum over outcomes and answers."""
    H = len(prior)
    weight, joint = np.zeros(H), np.empty(H)
    for h in range(H):
        weight[groups[h]] += prior[h]
    bits = 0.0
    for o in range(len(likelihood)):
        joint[:] = 0.0
        for h in range(H):
            joint[groups[h]] += prior[h] * likelihood[o, h]
        total = joint.sum()
        for g in range(H):
            if joint[g] > 0.0 and total > 0.0:
                bits += joint[g] * math.log2(joint[g] / (weight[g] * total))
    return max(bits, 0.0)


@njit(cache=True)
def _fill_bins(bins, mean, sigma):
    """Probabilities of the score bins under a Gaussian cut off at 0 and 1."""
    first = _below(-mean / sigma)
    low = first
    for s in range(SCORE_BINS):
        high = _below(((s + 1.0) / SCORE_BINS - mean) / sigma)
        bins[s] = high - low
        low = high
    bins /= low - first


@njit(cache=True)
def _below(z):
    """Standard normal distribution function."""
    return 0.5 * math.erfc(-z / math.sqrt(2.0))
