"""Weights, rates and prior of `ExistenceModel` by maximum likelihood of what landmarks truly are.

    maximise  mean_n log p(truth_n | Z_n)  -  ridge Σ log^2 w

over landmarks n of known truth ("no object" or a class), with p the model's own posterior. The ridge pulls the weights
towards 1, the papers' model, where there is nothing to learn.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logit

from ...factors.existence import ExistenceModel
from .landmarks import LandmarkSamples

RIDGE = 0.003  # nats a landmark for a weight off by e
LEAST, MOST = 0.02, 5.0  # of weights
RATE = (0.05, 50.0)  # of the Beta parameters
SHARE = (0.001, 0.995)  # of prior, correlation, confusion, surface
_SHARES = ("null_prior", "score_correlation", "steady_confusion", "surface")
_RATES = ("object_rate", "none_rate")
_WEIGHTS = ("weight_score", "weight_rate", "weight_free", "weight_depth", "weight_size")


def fit_existence(samples: LandmarkSamples, start: ExistenceModel = ExistenceModel()) -> ExistenceModel:  # noqa: B008
    """The model under which the truth is likeliest; `samples` with their sizes' evidence (`with_size`)."""
    rows, truth = np.arange(len(samples)), samples.label + 1

    def loss(x: np.ndarray) -> float:
        belief = _model(x).log_belief(samples.evidence)
        top = belief.max(axis=1)
        log_total = top + np.log(np.exp(belief - top[:, None]).sum(axis=1))
        weights = x[len(_SHARES) + 2 * len(_RATES) :]
        return float(np.mean(log_total - belief[rows, truth]) + RIDGE * np.sum(weights**2))

    bounds = [tuple(logit(SHARE))] * len(_SHARES) + [tuple(np.log(RATE))] * 4
    bounds += [tuple(np.log((LEAST, MOST)))] * len(_WEIGHTS)
    found = minimize(loss, _numbers(start), method="L-BFGS-B", bounds=bounds, options={"maxiter": 200})
    return _model(found.x)


def _numbers(model: ExistenceModel) -> np.ndarray:
    shares = [float(logit(np.clip(getattr(model, name), *SHARE))) for name in _SHARES]
    rates = [float(np.log(value)) for name in _RATES for value in getattr(model, name)]
    return np.array([*shares, *rates, *(float(np.log(getattr(model, name))) for name in _WEIGHTS)])


def _model(x: np.ndarray) -> ExistenceModel:
    shares, rates = expit(x[: len(_SHARES)]), np.exp(x[len(_SHARES) : len(_SHARES) + 4])
    weights = np.exp(x[len(_SHARES) + 4 :])
    values = dict(zip((*_SHARES, *_WEIGHTS), map(float, (*shares, *weights)), strict=True))
    pairs = {name: (float(rates[2 * k]), float(rates[2 * k + 1])) for k, name in enumerate(_RATES)}
    return replace(ExistenceModel(), **values, **pairs)
