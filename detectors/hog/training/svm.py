"""One linear support vector machine, in the form that a template needs."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from ....datasets.errors import UserError
from ....datasets.extras import install_command

BIAS_SCALE = 10  # liblinear shrinks the bias like a weight; on a column of tens that is next to nothing
TOLERANCE = 1e-3  # of the gradient, relative: hard negatives move the weights by far more from round to round
ITERATIONS = 200


def check_installed() -> None:
    """Raises `UserError` where scikit-learn is not installed."""
    try:
        import sklearn.svm  # noqa: F401
    except ImportError:
        raise UserError(f"training needs scikit-learn; install it with: {install_command('train')}") from None


def fit_svm(positives: np.ndarray, negatives: np.ndarray, cost: float) -> tuple[np.ndarray, float]:
    """Weights and bias that separate positives from negatives.

        min_w  |w|^2 / 2 + C sum_i max(0, 1 - y_i (w . x_i + b))^2

    The squared hinge in the primal: liblinear's Newton method for it draws no random numbers, so that the result does
    not depend on what other threads do, and it took as long as the dual one (1.6 s for 2600 x 5248). It lets other
    threads run.

    Args:
        positives, negatives: (P, D) and (N, D), P > 0 and N > 0.
        cost: C.

    Returns:
        (D,) float64 weights and the bias.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.svm import LinearSVC

    samples = np.concatenate([positives, negatives]).astype(np.float64)
    labels = np.concatenate([np.ones(len(positives)), -np.ones(len(negatives))])
    options: dict[str, Any] = {"dual": False, "intercept_scaling": BIAS_SCALE}  # a type checker's stub has these wrong
    machine = LinearSVC(C=cost, tol=TOLERANCE, max_iter=ITERATIONS, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # the next round starts over with other negatives anyway
        machine.fit(samples, labels)
    return np.asarray(machine.coef_)[0], float(np.asarray(machine.intercept_)[0])
