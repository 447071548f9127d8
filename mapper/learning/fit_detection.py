"""`DetectionModel` from samples: penalised logistic regression of "was found", a template at a time.

The coefficients minimise

    Σ_t log(1 + exp(-y_t η_t)) + a/2 Σ_k intercept_k^2 + b/2 Σ (second differences of f - f0 and g - g0)^2
        + c/2 Σ (first differences)^2 + d/2 (pooled - pooled0)^2,   η = pooled + intercept_k + f(visible) + g(log2 side)

y being 1 where the object was found and -1 where it was missed; pooled0, f0 and g0 are the generic model's. So a class
is drawn to the pooled one, and that to the generic model. Beyond the sizes and shares that were seen a curve runs
beside the generic one: a line drawn on into the unknown would say that large objects are hard to find. In the result f
is 0 in full view and g at 128 px: the intercepts are the logits of P_D there. Newton's method; the loss is convex.
"""

from __future__ import annotations

import numpy as np
from scipy.special import expit

from ...factors.detection_model import LOG2_SIDE_KNOTS, LOGIT, VISIBLE_KNOTS, DetectionModel
from ...factors.evidence_model import generic_evidence_model
from ...factors.learned_numbers import TEMPLATES
from .config import LearningConfig
from .samples import Samples

SIDE_ZERO = int(np.flatnonzero(LOG2_SIDE_KNOTS == 7.0)[0])  # the knot of 128 px
STEPS, CLOSE = 50, 1e-8  # Newton steps at most, and the change of the loss at which they end
ANCHOR = 1e4  # penalty of what is to be zero
CURVES = len(VISIBLE_KNOTS) + len(LOG2_SIDE_KNOTS)


def fit_detection(samples: Samples, classes: np.ndarray, config: LearningConfig) -> DetectionModel:
    """Fits every template; an object that cannot be seen at all is no trial.

    Args:
        samples: trials.
        classes: (K,) columns of the samples that become the model's classes.
        config: penalties.
    """
    K = len(classes)
    intercept, visible = np.zeros((K + 1, TEMPLATES)), np.zeros((TEMPLATES, len(VISIBLE_KNOTS)))
    side = np.zeros((TEMPLATES, len(LOG2_SIDE_KNOTS)))
    penalty, generic = _penalty(K, config), generic_evidence_model().detection
    for part in range(TEMPLATES):
        trial = (samples.part == part) & (samples.visible > 0.0) & np.isin(samples.class_id, classes)
        member = samples.class_id[trial, None] == classes
        log2_side = np.log2(np.maximum(samples.side_px[trial], 1.0))
        f_basis, f_ends = _basis(samples.visible[trial], VISIBLE_KNOTS, config)
        g_basis, g_ends = _basis(log2_side, LOG2_SIDE_KNOTS, config)
        curves = np.hstack([f_basis, g_basis])
        design = np.hstack([np.ones((len(member), 1)), member, curves])
        anchored = _anchored(penalty, 1 + K + f_ends[1], 1 + K + len(VISIBLE_KNOTS) + g_ends[1])
        offset = generic_logit(generic, samples.visible[trial], log2_side, part)
        w = _fit_logistic(design, offset, samples.found[trial].astype(np.float64), anchored)
        f, g = np.split(w[1 + K :], [len(VISIBLE_KNOTS)])
        f = generic.visible[part] + _flat_beyond(f, f_ends)
        g = generic.side[part] + _flat_beyond(g, g_ends)
        intercept[:, part] = generic.intercept[0, part] + w[0] + np.append(w[1 : 1 + K], 0.0) + f[-1] + g[SIDE_ZERO]
        visible[part], side[part] = f - f[-1], g - g[SIDE_ZERO]
    names = tuple(samples.classes[k] for k in classes)
    return DetectionModel(names, *(np.clip(array, *LOGIT) for array in (intercept, visible, side)))


def generic_logit(generic: DetectionModel, visible: np.ndarray, log2_side: np.ndarray, part: int) -> np.ndarray:
    """(T,) pooled0 + f0 + g0 of a template."""
    f = generic.intercept[0, part] + np.interp(visible, VISIBLE_KNOTS, generic.visible[part])
    return f + np.interp(log2_side, LOG2_SIDE_KNOTS, generic.side[part])


def _basis(x: np.ndarray, knots: np.ndarray, config: LearningConfig) -> tuple[np.ndarray, tuple[int, int]]:
    """(T, M) hat functions of x cut to the knots that enough of it is near to, and the first and last of those."""
    weight = hat_basis(x, knots).sum(axis=0)
    near = np.flatnonzero(weight >= min(config.pseudo_votes, weight.max()))
    first, last = int(near[0]), int(near[-1])
    return hat_basis(np.clip(x, knots[first], knots[last]), knots), (first, last)


def _flat_beyond(values: np.ndarray, ends: tuple[int, int]) -> np.ndarray:
    """Values at knots, those outside the ends made those at the ends."""
    return values[np.clip(np.arange(len(values)), *ends)]


def hat_basis(x: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """(T, M) weights by which the values at M knots make a piecewise linear function, constant beyond the outer two."""
    return np.stack([np.interp(x, knots, unit) for unit in np.eye(len(knots))], axis=1)


def _penalty(K: int, config: LearningConfig) -> np.ndarray:
    """Matrix P of the penalty w^T P w / 2 over [pooled, classes, f, g]."""
    P = np.zeros((1 + K + CURVES, 1 + K + CURVES))
    P[0, 0] = config.pooled_ridge
    P[np.arange(1, 1 + K), np.arange(1, 1 + K)] = config.class_ridge
    first = 1 + K
    for count in (len(VISIBLE_KNOTS), len(LOG2_SIDE_KNOTS)):
        block = slice(first, first + count)
        slope, bend = np.diff(np.eye(count), axis=0), np.diff(np.eye(count), n=2, axis=0)
        P[block, block] = config.curvature * bend.T @ bend + config.slope * slope.T @ slope
        first += count
    return P


def _anchored(penalty: np.ndarray, *zeros: int) -> np.ndarray:
    """The penalty that keeps these coefficients at zero: a constant could stand in f and g as well as in `pooled`."""
    P = penalty.copy()
    P[zeros, zeros] += ANCHOR
    return P


def _fit_logistic(X: np.ndarray, offset: np.ndarray, y: np.ndarray, penalty: np.ndarray) -> np.ndarray:
    """(M,) coefficients of X (T, M) beside the offset (T,); y (T,) is 1 where the object was found, else 0."""

    def loss(w: np.ndarray) -> float:
        z = offset + X @ w
        return float(np.sum(np.logaddexp(0.0, z) - y * z) + 0.5 * w @ penalty @ w)

    w = np.zeros(X.shape[1])
    value = loss(w)
    for _ in range(STEPS):
        p = expit(offset + X @ w)
        gradient = X.T @ (p - y) + penalty @ w
        hessian = (X * (p * (1.0 - p))[:, None]).T @ X + penalty
        step = np.linalg.solve(hessian, gradient)
        while (new := loss(w - step)) > value and np.abs(step).max() > 1e-12:
            step = step / 2.0
        w, change, value = w - step, value - new, new
        if change < CLOSE:
            break
    return w
