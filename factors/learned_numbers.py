"""Arrays of learned numbers: checked when a model is made of them, and never written to afterwards.

What is learned for each class has one row a class and a last row, pooled over all, for classes that were not learned.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .size_table import plain_name

TEMPLATES = 5  # whole, top, bottom, left, right: `VolumePart`


def checked_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names of what was learned; a detector may well call two of its classes nearly the same.

    Raises:
        ValueError: two of them are the same but for case, `_` and `-`.
    """
    plain = [plain_name(name) for name in names]
    if len(set(plain)) < len(plain):
        twice = next(name for k, name in enumerate(plain) if name in plain[:k])
        raise ValueError(f"the class {twice!r} twice")
    return tuple(names)


def rows_of(known: Sequence[str], wanted: Sequence[str]) -> np.ndarray:
    """(K + 1,) row of each of K wanted names among the known ones, and the pooled row (also of names not known)."""
    row = {plain_name(name): k for k, name in enumerate(known)}
    return np.array([*(row.get(plain_name(name), len(known)) for name in wanted), len(known)])


def checked_array(name: str, values: object, shape: tuple[int, ...], limits: tuple[float, float]) -> np.ndarray:
    """The values as a contiguous float64 array that cannot be written to.

    Raises:
        ValueError: they are not of the shape, or one is not within the limits; it says which.
    """
    array = np.array(values, dtype=np.float64, order="C")
    if array.shape != shape:
        raise ValueError(f"{name} of shape {array.shape} instead of {shape}")
    low, high = limits
    wrong = ~((array >= low) & (array <= high))  # NaN too
    if wrong.any():
        place = np.unravel_index(int(np.argmax(wrong)), shape)
        index = ", ".join(map(str, place))
        raise ValueError(f"{name}[{index}] = {array[place]:g} instead of a number from {low:g} to {high:g}")
    array.setflags(write=False)
    return array


def checked_gaussian(mean: object, covariance: object) -> tuple[np.ndarray, np.ndarray]:
    """(3,) mean and (3, 3) covariance.

    Raises:
        ValueError: as `checked_array`; or the covariance is not symmetric and positive definite.
    """
    mean = checked_array("mean", mean, (3,), (-100.0, 100.0))
    covariance = checked_array("covariance", covariance, (3, 3), (-100.0, 100.0))
    if not np.allclose(covariance, covariance.T) or np.linalg.eigvalsh(covariance)[0] <= 0.0:
        raise ValueError(f"covariance {covariance.tolist()} instead of a symmetric and positive definite one")
    return mean, covariance
