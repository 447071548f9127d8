"""From normalised scores to the distribution over classes and background, fitted on a validation set (section III-B).

"The range of the score distribution is identified by running the single-view detector on a validation set, in order to
get a correspondence between a score value and a probability": here by multinomial logistic regression,

    log p(c) - log p(background) = slope_c s_c + offset_c,  or absent_c where class c has no hypothesis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax

RIDGE = 1e-2  # weight of a squared parameter beside the samples' log likelihood: keeps what can be told apart finite
MOST_STEPS = 500


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """The parameters of C classes.

    Attributes:
        slope: (C,), not negative.
        offset: (C,).
        absent: (C,).

    Raises:
        ValueError: they are not so.
    """

    slope: np.ndarray
    offset: np.ndarray
    absent: np.ndarray

    def __post_init__(self) -> None:
        for name in ("slope", "offset", "absent"):
            array = np.asarray(getattr(self, name), dtype=np.float64)
            if array.ndim != 1 or len(array) != len(self.slope) or not np.isfinite(array).all():
                raise ValueError(f"{name} must be finite numbers, one for each class, but got {array}")
            object.__setattr__(self, name, array)
        if (self.slope < 0.0).any():
            raise ValueError(f"slope must not be negative, but got {self.slope}")

    def distribution(self, normalised: np.ndarray) -> np.ndarray:
        """(N, C + 1) probabilities that add up to 1, the background's last, from (N, C) scores, NaN where none."""
        present = np.isfinite(normalised)
        odds = np.where(present, self.slope * np.nan_to_num(normalised) + self.offset, self.absent)
        return softmax(np.column_stack([odds, np.zeros(len(odds))]), axis=1)


def fit_calibration(normalised: np.ndarray, label: np.ndarray, weight: np.ndarray | None = None) -> Calibration:
    """Most likely parameters under a weak Gaussian prior.

    Args:
        normalised: (N, C) scores, NaN where none; N > 0.
        label: (N,) int, the true class of each sample, C for background.
        weight: (N,) how often each counts, 1 by default.

    Raises:
        ValueError: shapes that differ, or a label out of range.
    """
    normalised = np.asarray(normalised, dtype=np.float64)
    count = normalised.shape[1]
    weight = np.ones(len(normalised)) if weight is None else np.asarray(weight, dtype=np.float64)
    if not len(normalised) == len(label) == len(weight) > 0:
        raise ValueError(
            f"need as many labels and weights as samples, at least one, but got {len(normalised)}, "
            f"{len(label)}, {len(weight)}"
        )
    if label.min() < 0 or label.max() > count:
        raise ValueError(f"labels must be in 0..{count}, but range from {label.min()} to {label.max()}")
    present = np.isfinite(normalised)
    score = np.nan_to_num(normalised)
    true = np.zeros((len(label), count + 1))
    true[np.arange(len(label)), label] = 1.0

    def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
        slope, offset, absent = parameters.reshape(3, count)
        odds = np.where(present, slope * score + offset, absent)
        log_p = log_softmax(np.column_stack([odds, np.zeros(len(odds))]), axis=1)
        off = (weight[:, None] * (np.exp(log_p) - true))[:, :count]
        gradient = np.stack(
            [(off * score * present).sum(axis=0), (off * present).sum(axis=0), (off * ~present).sum(axis=0)]
        ).ravel()
        value = -float(weight @ (log_p * true).sum(axis=1)) + 0.5 * RIDGE * float(parameters @ parameters)
        return value, gradient + RIDGE * parameters

    start = np.concatenate([np.ones(count), np.zeros(2 * count)])
    bounds = [(0.0, None)] * count + [(None, None)] * (2 * count)
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": MOST_STEPS})
    return Calibration(*found.x.reshape(3, count))
