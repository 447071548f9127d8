"""From scores to the distribution over classes and background, fitted on a validation set (section III-B).

"The range of the score distribution is identified by running the single-view detector on a validation set, in order to
get a correspondence between a score value and a probability": here by multinomial logistic regression,

    log p(c) - log p(background) = weights_c . features_c + offset_c,

on the normalised score, which decides most, and what else is known of a proposal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_softmax, logit, softmax

from .scoring import ImageScores

FEATURES = ("hypothesis", "log strength", "agreement", "contour", "objectness")
SIGNED = (False, True, True, True, True)  # whether more of it must not make a class less probable
WEAKEST = 1e-3  # s / mu below which a score says no less
LIMIT = 6.0  # log-odds beyond which objectness says no more
RIDGE = 1e-2  # weight of a squared parameter beside the samples' log likelihood: keeps what can be told apart finite
MOST_STEPS = 500


def calibration_features(scores: ImageScores, objectness: np.ndarray) -> np.ndarray:
    """(N, C, F) features of N proposals for C classes, the last axis as `FEATURES`.

    "hypothesis" is 1 where a class has a verified one, "log strength" is log(s / mu), a monotone function of the
    normalised score, and 0 without a hypothesis; "objectness" are the log-odds of the proposal being one whole thing.

    Args:
        scores: of the proposals.
        objectness: (N,) probabilities.
    """
    present = np.isfinite(scores.normalised)
    strength = np.where(present, np.log(np.maximum(scores.strength, WEAKEST)), 0.0)
    odds = np.clip(logit(np.asarray(objectness, dtype=np.float64)), -LIMIT, LIMIT)
    of_proposal = np.broadcast_to(odds[:, None], present.shape)
    return np.stack([present.astype(np.float64), strength, scores.agreement, scores.contour, of_proposal], axis=2)


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """The parameters of C classes.

    Attributes:
        weights: (C, F), of each feature.
        offset: (C,).

    Raises:
        ValueError: they are not finite numbers of these shapes.
    """

    weights: np.ndarray
    offset: np.ndarray

    def __post_init__(self) -> None:
        for name, shape in (("weights", (len(self.offset), len(FEATURES))), ("offset", (len(self.offset),))):
            array = np.asarray(getattr(self, name), dtype=np.float64)
            if array.shape != shape or not np.isfinite(array).all():
                raise ValueError(f"{name} must be {shape} finite numbers, but got shape {array.shape}")
            object.__setattr__(self, name, array)

    def distribution(self, features: np.ndarray) -> np.ndarray:
        """(N, C + 1) probabilities that add up to 1, the background's last, from (N, C, F) features."""
        odds = (features * self.weights).sum(axis=2) + self.offset
        return softmax(np.column_stack([odds, np.zeros(len(odds))]), axis=1)


def fit_calibration(features: np.ndarray, label: np.ndarray, weight: np.ndarray | None = None) -> Calibration:
    """Most likely parameters under a weak Gaussian prior.

    Args:
        features: (N, C, F), N > 0.
        label: (N,) int, the true class of each sample, C for background.
        weight: (N,) how often each counts, 1 by default.

    Raises:
        ValueError: shapes that differ, or a label out of range.
    """
    features = np.asarray(features, dtype=np.float64)
    count, wide = features.shape[1:]
    weight = np.ones(len(features)) if weight is None else np.asarray(weight, dtype=np.float64)
    if not len(features) == len(label) == len(weight) > 0:
        sizes = f"{len(features)}, {len(label)}, {len(weight)}"
        raise ValueError(f"need as many labels and weights as samples, at least one, but got {sizes}")
    if label.min() < 0 or label.max() > count:
        raise ValueError(f"labels must be in 0..{count}, but range from {label.min()} to {label.max()}")
    true = np.zeros((len(label), count + 1))
    true[np.arange(len(label)), label] = 1.0

    def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
        table = parameters.reshape(count, wide + 1)
        odds = (features * table[:, :wide]).sum(axis=2) + table[:, wide]
        log_p = log_softmax(np.column_stack([odds, np.zeros(len(odds))]), axis=1)
        off = (weight[:, None] * (np.exp(log_p) - true))[:, :count]
        gradient = np.column_stack([(off[:, :, None] * features).sum(axis=0), off.sum(axis=0)]).ravel()
        value = -float(weight @ (log_p * true).sum(axis=1)) + 0.5 * RIDGE * float(parameters @ parameters)
        return value, gradient + RIDGE * parameters

    bounds = [(0.0 if signed else None, None) for signed in (*SIGNED, False)] * count
    start = np.zeros(count * (wide + 1))
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": MOST_STEPS})
    table = found.x.reshape(count, wide + 1)
    return Calibration(table[:, :wide], table[:, wide])
