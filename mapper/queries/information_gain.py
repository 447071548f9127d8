"""How much one more look should tell of a thing: mutual information, in bits, by exact sums.

Hypotheses h about a thing are "no object" and its classes; the outcomes o of a look are "not detected", and "detected
and named j with a score in bin s". With q(h) from the map, and G what is asked of h (is it there and what is it; is it
a `label`),

    I(G; O) = Σ_o Σ_g p(g, o) log2 p(g, o) / (p(g) p(o)),      p(g, o) = Σ_{h in g} q(h) p(o | h).

The likelihoods are those of the mapper's own evidence (`factors/existence.py`, `factors/score_model.py`). A look
detects an object with e r_1 and what is none with e r_0: e is P_D relative to its best where so much shows at that
size, r = (a + h) / (a + b + h + m) the rate that is expected after the h hits and m misses so far. What is detected

    none        steadily looks like class j, with the probability b_j that the map gives j: background's scores
    a k         is named k with the scores of its own class (1 - c), or any other class with any score (c); or it
                steadily looks like another class (t_k): background's scores, as for none

P(steady) t_k is pi a priori. After the views so far it is the share of p(k) that this explains, with b_j standing for
how well j fits what was named: pi (1 - b_k) / (K - 1) over the same plus (1 - pi) b_k. So a class that only a steady
mistake could still hide behind is not thought to show itself in the next view.

Classes beyond the likeliest few are one hypothesis, and one name, which can only lose information. Above an occlusion
of 0.7 a look says nothing (`TRUNCATION`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...factors.evidence_model import EvidenceModel
from .information_kernel import look_gains

FEW = 4  # classes that are hypotheses of their own: detectors confuse few, and the time grows with the square
WHOLE = 0  # template
CERTAIN = 1.0 - 1e-9  # of a class beside which there is no other that could be taken for it
NEGLIGIBLE = 1e-12  # probability of a state that is left out: 4e-11 bits, and products of smaller ones underflow


@dataclass(frozen=True, slots=True, eq=False)
class Questions:
    """What is asked of N things, with J names (the likeliest classes, and all others as one) and J + 1 hypotheses.

    Attributes:
        prior: (N, J + 1) q, "no object" first.
        groups: (N, J + 1) int64, number of the answer that each hypothesis is.
        looks_like: (N, J) b.
        steady: (N, J) t.
        counts: (N, J) classes of each name: 1, and however many the others are.
        own, own_sigma: (N, J, 10) Gaussians of own scores by bin of occlusion.
        background: (N, J, 2) mean and standard deviation of the scores of false detections.
        rates: (N, 2) r_0, r_1.
        confusion: c.
        bits: (N,) entropy of the answer: no look can tell more.
    """

    prior: np.ndarray
    groups: np.ndarray
    looks_like: np.ndarray
    steady: np.ndarray
    counts: np.ndarray
    own: np.ndarray
    own_sigma: np.ndarray
    background: np.ndarray
    rates: np.ndarray
    confusion: float
    bits: np.ndarray

    def gains(self, numbers: np.ndarray, visible: np.ndarray, expected: np.ndarray) -> np.ndarray:
        """(M,) bits of M looks.

        Args:
            numbers: (M,) of the things looked at.
            visible: (M,) share of each in sight.
            expected: (M,) e, in [0, 1].
        """
        gains = np.zeros(len(numbers))
        states = self.prior, self.groups, self.looks_like, self.steady, self.counts
        scores = self.own, self.own_sigma, self.background
        looks = np.asarray(numbers, np.int64), np.asarray(visible, float), np.asarray(expected, float)
        look_gains(*looks, *states, *scores, self.rates, float(self.confusion), gains)
        return gains


def make_questions(
    existence: np.ndarray,
    posterior: np.ndarray,
    hits: np.ndarray,
    misses: np.ndarray,
    model: EvidenceModel,
    labels: Sequence[int] | None = None,
) -> Questions:
    """What is asked of N things.

    Args:
        existence: (N,) of them.
        posterior: (N, K) class probabilities, given that they exist; they may sum to less than 1.
        hits, misses: (N,) independent views in which each was detected, and in which it should have been.
        model: bound to the K classes.
        labels: classes one of which is asked for; None to ask of each whether it is there and what it is.
    """
    N, K = posterior.shape
    total = posterior.sum(axis=1, keepdims=True)
    posterior = np.where(total > 0.0, posterior / np.where(total > 0.0, total, 1.0), 1.0 / K)
    chosen = _likeliest(posterior, labels or ())
    few, more = chosen.shape[1], int(chosen.shape[1] < K)
    shares = np.take_along_axis(posterior, chosen, axis=1)
    if more:
        shares = np.column_stack([shares, np.maximum(1.0 - shares.sum(axis=1), 0.0)])
    counts = np.ones(shares.shape)
    counts[:, few:] = K - few
    prior = np.column_stack([1.0 - existence, existence[:, None] * shares])
    prior[prior < NEGLIGIBLE] = 0.0
    groups = np.tile(np.arange(few + more + 1), (N, 1))
    if labels is not None:
        groups = np.column_stack([np.zeros(N), np.isin(chosen, labels), np.zeros((N, more))]).astype(np.int64)
    rows = np.column_stack([chosen, np.full((N, more), K)])  # the last one is pooled over all classes
    scores, e = model.scores, model.existence
    background = np.stack([scores.background_mean[rows, WHOLE], scores.background_sigma[rows, WHOLE]], axis=-1)
    return Questions(
        prior=prior,
        groups=groups,
        looks_like=shares,
        steady=_steady(shares / counts, K, e.steady_confusion),
        counts=counts,
        own=scores.mean[rows, WHOLE],
        own_sigma=scores.sigma[rows, WHOLE],
        background=background,
        rates=np.column_stack([_rate(e.none_rate, hits, misses), _rate(e.object_rate, hits, misses)]),
        confusion=float(scores.confusion[WHOLE]) if K > 1 else 0.0,
        bits=_entropies(prior, groups),
    )


def _likeliest(posterior: np.ndarray, labels: Sequence[int]) -> np.ndarray:
    """(N, J) classes, the likeliest first; what is asked for is always among them."""
    ranked = posterior.copy()
    ranked[:, list(labels)] += 2.0
    return np.argsort(-ranked, axis=1, kind="stable")[:, : max(FEW, len(labels))]


def _steady(each: np.ndarray, classes: int, confusion: float) -> np.ndarray:
    """(N, J) t from b of one class of each name."""
    mistaken = confusion * (1.0 - each) / max(classes - 1, 1)
    return np.where(each < CERTAIN, mistaken / (mistaken + (1.0 - confusion) * each + 1e-300), 0.0)


def _rate(prior: tuple[float, float], hits: np.ndarray, misses: np.ndarray) -> np.ndarray:
    a, b = prior
    return (a + hits) / (a + b + hits + misses)


def _entropies(prior: np.ndarray, groups: np.ndarray) -> np.ndarray:
    p = np.stack([np.where(groups == g, prior, 0.0).sum(axis=1) for g in range(prior.shape[1])], axis=1)
    return -(p * np.log2(np.where(p > 0.0, p, 1.0))).sum(axis=1)
