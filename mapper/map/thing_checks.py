"""What the numbers of a thing may be, checked for one thing or for many at once.

Maps have 100,000 things. NumPy's overhead for a few numbers is longer than all else that is done to read a thing, so
that what is read from a file is checked in arrays over all things, by the same rules.
"""

from __future__ import annotations

import numpy as np

POSTERIOR_TOLERANCE = 1e-4  # how far `probability` and `class_posterior[label]` may differ through rounding
ROUNDING = 1e-6  # of a covariance's largest value: by how much it may fail to be one


def read_only(name: str, value: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """A float64 copy that nobody can change; raises `ValueError` where it is not finite or has another shape."""
    array = np.array(value, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, but got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, but got {array.tolist()}")
    array.setflags(write=False)
    return array


def finite(name: str, value: float) -> float:
    """A plain float; raises `ValueError` where it is not finite."""
    number = float(value)
    if not np.isfinite(number):
        raise ValueError(f"{name} must be finite, but got {number}")
    return number


def check_covariance(name: str, covariance: np.ndarray) -> None:
    """Raise `ValueError` where (3, 3) is not symmetric or has a negative eigenvalue, up to rounding."""
    slack = ROUNDING * np.abs(covariance).max()
    if np.any(np.abs(covariance - covariance.T) > slack):
        raise ValueError(f"{name} must be symmetric, but got {covariance.tolist()}")
    if np.linalg.eigvalsh(covariance)[0] < -slack:
        raise ValueError(f"{name} must have no negative eigenvalue, but got {covariance.tolist()}")


def are_covariances(matrices: np.ndarray) -> bool:
    """Whether all of (N, 3, 3) finite matrices are symmetric and have no negative eigenvalue, up to rounding.

    Most are found right by Sylvester's criterion: with all leading minors positive, all eigenvalues are.
    """
    slack = ROUNDING * np.abs(matrices).max(axis=(1, 2), initial=0.0)
    if np.any(np.abs(matrices - matrices.transpose(0, 2, 1)) > slack[:, None, None]):
        return False
    (a, b, c), (_, d, e), (_, _, f) = np.moveaxis(matrices, 0, -1)
    a, d, f = a + slack, d + slack, f + slack
    plane = a * d - b * b
    positive = (a > 0.0) & (plane > 0.0) & (a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d) > 0.0)
    rest = ~positive  # on the edge, or no covariance
    return not np.any(np.linalg.eigvalsh(matrices[rest])[:, 0] < -slack[rest])
